"""Many devices: functions with Arrow in and out, for engines that spread work over processes and machines.

`identify_device` answers one device and never raises for what is wrong with it: a device that fails is a row. Dask and Spark
call it as it is; `identify_table` answers a table of several devices, one after the other.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import dataset, parquet

from . import _cvg, identify
from ._errors import InputError, NoAnswer
from ._input import Path, Run, is_path
from ._report import Report

#: the column that tells devices apart, and the one that tells the recordings of a device apart
DEVICE, RUN = "device", "run"
#: what a campaign file says of a device and of a run may stand in columns of these names, each the same in all its rows
OF_DEVICE = ("instrument", "carrier_hz", "angular_gain", "period_deg", "pole_pairs", "reference", "temperature_c")
OF_RUN = ("kind", "settle_s", "use", "amplitude", "angle_deg", "energy_off_s")

PARAMETER = pa.struct(
    [("name", pa.string()), ("unit", pa.string()), ("value", pa.float64()), ("low", pa.float64()), ("high", pa.float64())]
)
#: a row for each device; `report` is report.json and `calibration` calibration.toml, as the command writes them
SCHEMA = pa.schema(
    [
        ("device", pa.string()),
        ("status", pa.string()),
        ("reason", pa.string()),
        ("raw_rms_deg", pa.float64()),
        ("declared_rms_deg", pa.float64()),
        ("discovered_rms_deg", pa.float64()),
        ("noise_floor_deg", pa.float64()),
        ("effects", pa.list_(pa.string())),
        ("parameters", pa.list_(PARAMETER)),
        ("report", pa.string()),
        ("calibration", pa.string()),
    ]
)


def _answered(report: Report) -> dict[str, Any]:
    facts = report.to_dict()
    heldout = facts.get("heldout") or {}
    calibration = report.calibration
    row: dict[str, Any] = {name: facts.get(name) for name in ("device", "status", "reason")}
    for stage in ("raw", "declared", "discovered"):
        row[f"{stage}_rms_deg"] = (heldout.get(stage) or {}).get("rms_deg")
    row["noise_floor_deg"] = heldout.get("noise_floor_deg")
    row["effects"] = [e["id"] for e in facts.get("effects", []) if e.get("origin") != "declared"]
    row["parameters"] = [p._asdict() for p in report.parameters]
    row["report"] = report.to_json()
    row["calibration"] = None if calibration is None else calibration.to_text()
    return row


def _refused(device: str, reason: str, report: str | None) -> dict[str, Any]:
    if report is not None:
        device = str(json.loads(report)["device"])
    return {"device": device, "status": "refused", "reason": reason, "report": report}


def _one(table: pa.Table, name: str, of: str) -> Any:
    """The value that a column has in all rows."""
    values = pc.unique(table[name]).to_pylist()
    if len(values) != 1:
        raise InputError(f"{of}: `{name}` has {len(values)} values; wanted one in all its rows")
    return values[0]


def _runs(table: pa.Table, device: str) -> tuple[list[Run], dict[str, object]]:
    """The recordings in the rows of one device, in the order in which they begin, and what is said of the device."""
    head: dict[str, object] = {"device": device}
    head |= {word: _one(table, word, device) for word in OF_DEVICE if word in table.column_names}
    names = pc.unique(table[RUN]).to_pylist() if RUN in table.column_names else ["recording"]
    said = [word for word in (DEVICE, RUN, *OF_DEVICE, *OF_RUN) if word in table.column_names]
    runs = []
    for name in names:
        rows = table.filter(pc.equal(table[RUN], name)) if RUN in table.column_names else table
        words = {word: _one(rows, word, f"{device}, {name}") for word in OF_RUN if word in rows.column_names}
        holdout = words.pop("use", None) == "holdout"
        words["kind"] = words.get("kind") or "rotation"
        data = rows.drop_columns(said)
        # a column that another run or device has alone
        there = [c for c in data.column_names if data[c].null_count < len(data)]
        runs.append(Run(data.select(there), str(name), holdout=holdout, **words))
    return runs, head


def identify_device(x: Any, **options: Any) -> pa.Table:
    """Answers one device: a row of `SCHEMA`.

    `x` is the path of a campaign or a recording, or an Arrow table (or what `pyarrow.table` makes one of) of one device's
    rows, with its recordings told apart by a column `run`. `options` are those of `cvg.identify`, but for `limits`, of which a row
    says nothing.
    """
    if options.get("limits") is not None:
        raise InputError("limits: a row does not say how they were met; wanted cvg.identify, or `cvg fleet --limits`")
    device = os.fspath(x) if is_path(x) else "device"
    try:
        if is_path(x):
            row = _answered(identify(x, **options))
        else:
            table = x if isinstance(x, pa.Table) else pa.table(x)
            if DEVICE in table.column_names:
                device = str(_one(table, DEVICE, "a device's table"))
            runs, head = _runs(table, device)
            row = _answered(identify(runs, campaign=head, **options))
    except NoAnswer as error:
        row = _refused(device, str(error), error.json)
    except (InputError, TypeError) as error:
        row = _refused(device, str(error), None)
    return pa.Table.from_pylist([row], schema=SCHEMA)


def devices(table: pa.Table) -> Iterator[tuple[str, pa.Table]]:
    """The devices in a table and their rows, in the order in which they begin."""
    for device in pc.unique(table[DEVICE]).to_pylist():
        yield str(device), table.filter(pc.equal(table[DEVICE], device))


def identify_table(table: pa.Table, **options: Any) -> pa.Table:
    """Answers every device in a table, which holds all rows of each: a row of `SCHEMA` for each."""
    rows = [identify_device(own, **options) for _, own in devices(table)]
    return pa.concat_tables(rows) if rows else SCHEMA.empty_table()


def names(lake: Path) -> list[str]:
    """The devices in a lake: a Parquet file, or a folder of them."""
    column = dataset.dataset(lake).to_table(columns=[DEVICE])[DEVICE]
    return sorted(str(device) for device in pc.unique(column).to_pylist())


def identify_in(lake: Path, device: str, **options: Any) -> pa.Table:
    """Answers one device of a lake, of which no other row is kept."""
    return identify_device(dataset.dataset(lake).to_table(filter=pc.field(DEVICE) == device), **options)


def identify_lake(lake: Path, out: Path, **options: Any) -> pa.Table:
    """Answers every device of a lake into the Parquet file `out`, one after the other, and returns what is in it.

    Devices that `out` has are kept: a run that was broken off goes on where it was. Answers of another version of `cvg`
    are made anew; whether the lake is still the same is for the caller to know.
    """
    target = os.fspath(out)
    rows = {row["device"][0].as_py(): row for row in _kept(target)}
    for device in names(lake):
        if device not in rows:
            rows[device] = identify_in(lake, device, **options)
            # a file that is whole or not there
            parquet.write_table(pa.concat_tables(rows.values()), target + ".part")
            os.replace(target + ".part", target)
    return pa.concat_tables(rows.values()) if rows else SCHEMA.empty_table()


def _kept(target: str) -> Iterator[pa.Table]:
    if not os.path.exists(target):
        return
    table = parquet.read_table(target, schema=SCHEMA)
    for at, report in enumerate(table["report"].to_pylist()):
        if report is not None and json.loads(report)["tool"]["version"] == _cvg.__version__:
            yield table.slice(at, 1)


def population(rows: pa.Table | Iterable[pa.Table]) -> dict[str, Any]:
    """What the devices say together: the facts of fleet.json, as `cvg fleet` finds them in the same reports."""
    table = rows if isinstance(rows, pa.Table) else pa.concat_tables(rows)
    columns = (table[name].to_pylist() for name in ("device", "reason", "report"))
    facts: dict[str, Any] = json.loads(_cvg.population(list(zip(*columns))))
    return facts
