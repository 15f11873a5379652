"""Many devices: functions with Arrow in and out, for engines that spread work over processes and machines.

`identify_device` answers one device and never raises for what is wrong with it: a device that fails is a row. Dask and Spark
call it as it is; `identify_table` answers a table of several devices, one after the other.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import pathlib
import time
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import dataset, parquet

from . import _cvg, identify
from ._errors import InputError, NoAnswer
from ._input import Path, Run, is_path, several
from ._report import Report

#: the column that tells devices apart, and the one that tells the recordings of a device apart
DEVICE, RUN = "device", "run"
#: what a campaign file says of a device and of a run may stand in columns of these names, each the same in all its rows
OF_DEVICE = ("instrument", "carrier_hz", "angular_gain", "period_deg", "pole_pairs", "reference", "temperature_c")
OF_RUN = ("kind", "settle_s", "use", "amplitude", "angle_deg", "energy_off_s")

#: what the answers in a file of `identify_lake` rest on
BASIS = "cvg.basis"
#: a file of answers is written where what was answered since took this many times as long
SHARE = 20

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


def _plain_type(kind: pa.DataType) -> pa.DataType:
    """The type that Arrow's functions have for what polars hands out as views."""
    views = {pa.string_view(): pa.string(), pa.binary_view(): pa.binary()}
    return views.get(kind, kind)


def _plain_schema(schema: pa.Schema) -> pa.Schema:
    return pa.schema([field.with_type(_plain_type(field.type)) for field in schema])


def _table(x: Any) -> pa.Table:
    """A table of what is one in another library."""
    try:
        table = x if isinstance(x, pa.Table) else pa.table(x)
    except (pa.ArrowException, TypeError, ValueError) as error:
        raise InputError(f"{type(x).__name__} is no table: {error}; wanted an Arrow table, a frame or columns") from None
    return table.cast(_plain_schema(table.schema))


def _require_devices(schema: pa.Schema, of: str) -> None:
    """Refuses what has no column that tells devices apart."""
    if DEVICE not in schema.names:
        raise InputError(f"{of}: there is no column `{DEVICE}`, which tells devices apart; there are {', '.join(schema.names)}")
    kind = schema.field(DEVICE).type
    if pa.types.is_nested(kind):
        raise InputError(f"{of}: `{DEVICE}` is of the type {kind}; wanted names or numbers")


class _Lake(NamedTuple):
    """The rows of a lake, as types that Arrow's functions take, and the type that it has devices in."""

    rows: dataset.Dataset
    kind: pa.DataType


def _lake(lake: Path) -> _Lake:
    source = dataset.dataset(lake)
    _require_devices(source.schema, os.fspath(lake))
    plain = _plain_schema(source.schema)
    rows = source if plain == source.schema else dataset.dataset(lake, schema=plain)
    return _Lake(rows, source.schema.field(DEVICE).type)


def _require_options(options: dict[str, Any]) -> None:
    """Refuses options that no device could be answered with: they are the call's fault, and no device's."""
    if options.get("limits") is not None:
        raise InputError("limits: a row does not say how they were met; wanted cvg.identify, or `cvg fleet --limits`")
    known = [name for name in inspect.signature(identify).parameters if name not in ("x", "limits", "name", "campaign")]
    for name in options.keys() - {*known, "limits"}:
        raise TypeError(f"`{name}` is no option of a fleet; there are {', '.join(known)}")


def _one(table: pa.Table, name: str, of: str) -> Any:
    """The value that a column has in all rows."""
    values = pc.unique(table[name]).to_pylist()
    if len(values) != 1:
        raise InputError(f"{of}: `{name}` has {len(values)} values; wanted one in all its rows")
    return values[0]


def _names(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Names as text, whatever type a lake has for them; rows without one have an empty one."""
    return pc.fill_null(pc.cast(column, pa.string()), "")


def _runs(table: pa.Table, device: str) -> tuple[list[Run], dict[str, object]]:
    """The recordings in the rows of one device, in the order in which they begin, and what is said of the device."""
    head: dict[str, object] = {"device": device}
    head |= {word: _one(table, word, device) for word in OF_DEVICE if word in table.column_names}
    names, named = ["recording"], None
    # a column that says nothing is none
    if RUN in table.column_names and table[RUN].null_count < len(table):
        named = _names(table[RUN])
        names = pc.unique(named).to_pylist()
    if "" in names:
        some = pc.sum(pc.equal(named, "")).as_py()
        raise InputError(f"{device}: `run` says nothing in {some} of {len(table)} rows; wanted a name in each")
    said = [word for word in (DEVICE, RUN, *OF_DEVICE, *OF_RUN) if word in table.column_names]
    runs = []
    for name in names:
        rows = table if named is None else table.filter(pc.equal(named, name))
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
    says nothing, and for `name` and `campaign`, which the table says.
    """
    _require_options(options)
    device = os.fspath(x) if is_path(x) else "device"
    try:
        if is_path(x):
            row = _answered(identify(x, **options))
        else:
            table = _table(x)
            if DEVICE in table.column_names:
                device = str(_one(pa.table({DEVICE: _names(table[DEVICE])}), DEVICE, "a device's table"))
                if not device:
                    raise InputError(f"{len(table)} rows have no `device`; wanted a name in each")
            runs, head = _runs(table, device)
            row = _answered(identify(runs, campaign=head, **options))
    except NoAnswer as error:
        row = _refused(device, str(error), error.json)
    except (InputError, TypeError) as error:
        row = _refused(device, str(error), None)
    return pa.Table.from_pylist([row], schema=SCHEMA)


def devices(x: Any) -> Iterator[tuple[str, pa.Table]]:
    """The devices in a table and their rows, in the order in which they begin."""
    table = _table(x)
    _require_devices(table.schema, "the table")
    named = _names(table[DEVICE])
    for device in pc.unique(named).to_pylist():
        yield str(device), table.filter(pc.equal(named, device))


def identify_table(x: Any, **options: Any) -> pa.Table:
    """Answers every device in a table, which holds all rows of each: a row of `SCHEMA` for each."""
    _require_options(options)
    rows = [identify_device(own, **options) for _, own in devices(x)]
    return pa.concat_tables(rows) if rows else SCHEMA.empty_table()


def names(lake: Path) -> list[str]:
    """The devices in a lake: a Parquet file, or a folder of them."""
    column = _lake(lake).rows.to_table(columns=[DEVICE])[DEVICE]
    return sorted(pc.unique(_names(column)).to_pylist())


def identify_in(lake: Path, device: str, **options: Any) -> pa.Table:
    """Answers one device of a lake, of which no other row is kept."""
    return identify_device(_rows(_lake(lake), device), **options)


def _rows(lake: _Lake, device: str) -> pa.Table:
    """The rows of a device of a lake."""
    column, kind = pc.field(DEVICE), lake.kind
    if not device:
        return lake.rows.to_table(filter=column.is_null() | (column.cast(pa.string()) == ""))
    if pa.types.is_integer(kind):
        # by their numbers, by which row groups that have others are left unread
        return lake.rows.to_table(filter=column == pa.scalar(int(device), kind))
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_dictionary(kind):
        return lake.rows.to_table(filter=column == device)
    # what a row group says of its values cannot be compared with views
    return lake.rows.to_table(filter=column.cast(pa.large_string()) == device)


def identify_lake(lake: Path, out: Path, **options: Any) -> pa.Table:
    """Answers every device of a lake into the Parquet file `out`, one after the other, and returns what is in it.

    Answers that `out` has are kept where they rest on the same rows, the same options and the same version of `cvg`, so that a
    run that was broken off goes on where it was. What was answered is written whenever that takes little of the time, and
    where it ends, be it by an exception. Two programs at a time want two files. `out` lies outside of the lake.
    """
    _require_options(options)
    target = os.fspath(out)
    source = _lake(lake)
    if any(_is_within(target, part) for part in (lake, *getattr(source.rows, "files", ()))):
        raise InputError(f"{target}: is a part of the lake, which is not written over; wanted another name", target)
    kept, rows = _kept(target), {}
    asked = _asked(options)
    begun, wrote_s, changed = time.monotonic(), 0.0, False
    try:
        for device in names(lake):
            table = _rows(source, device)
            basis = f"{asked} {_sum(table)}"
            if kept.get(device, (None, ""))[1] == basis:
                rows[device] = kept[device]
                continue
            rows[device] = (identify_device(table, **options), basis)
            changed = True
            if time.monotonic() - begun > SHARE * wrote_s:
                # those that are yet to be looked at stay, too
                wrote_s, begun, changed = _write({**kept, **rows}, target), time.monotonic(), False
    except BaseException:
        if changed:
            _write({**kept, **rows}, target)
        raise
    if changed or list(rows) != list(kept):
        _write(rows, target)
    return pa.concat_tables([row for row, _ in rows.values()]) if rows else SCHEMA.empty_table()


def _is_within(path: Path, folder: Path) -> bool:
    """Whether a path is one that holds recordings, or lies below it."""
    own, other = pathlib.Path(path).resolve(), pathlib.Path(folder).resolve()
    return own == other or other in own.parents or (own.exists() and other.exists() and own.samefile(other))


def _asked(options: dict[str, Any]) -> str:
    """What an answer rests on beside the rows: the module as it was built, and the options, of files their bytes."""

    def said(name: str, value: Any) -> Any:
        if name in ("effects", "holdout"):
            return [_bytes(name, file) for file in several(value)]
        return list(value) if name == "map" and not isinstance(value, (str, dict)) else value

    # who is told what is going on changes nothing
    words = {name: said(name, value) for name, value in options.items() if name != "progress" and value is not None}
    # two builds of one version may answer differently
    text = json.dumps([_cvg.__version__, _bytes("cvg", _cvg.__file__), words], sort_keys=True, default=float)
    return hashlib.sha256(text.encode()).hexdigest()


def _bytes(name: str, file: Any) -> str:
    """A checksum of a file."""
    if not is_path(file):
        raise InputError(f"{name}: {type(file).__name__} is no path; what a lake is answered with is kept by its bytes")
    try:
        return hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{os.fspath(file)}: cannot be read: {error.strerror}", os.fspath(file)) from None


def _sum(table: pa.Table) -> str:
    """A checksum of rows: of the names of the columns, their types and values."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema.remove_metadata()) as stream:
        stream.write_table(table.combine_chunks().replace_schema_metadata())
    return hashlib.sha256(sink.getvalue()).hexdigest()


def _write(rows: dict[str, tuple[pa.Table, str]], target: str) -> float:
    """Writes answers into a file that is whole or not there, and says how long that took, in s."""
    begun = time.monotonic()
    table = pa.concat_tables([row for row, _ in rows.values()]) if rows else SCHEMA.empty_table()
    # by the lake's names: an option may say another
    basis = json.dumps([(device, basis) for device, (_, basis) in rows.items()])
    part = f"{target}.{os.getpid()}.part"
    try:
        parquet.write_table(table.replace_schema_metadata({BASIS: basis}), part)
        os.replace(part, target)
    finally:
        if os.path.exists(part):
            os.remove(part)
    return time.monotonic() - begun


def _kept(target: str) -> dict[str, tuple[pa.Table, str]]:
    """The answers that are there, and what each rests on."""
    if not os.path.exists(target):
        return {}
    table = parquet.read_table(target)
    said = (table.schema.metadata or {}).get(BASIS.encode())
    basis = json.loads(said) if said else []
    if len(basis) != len(table) or table.schema.remove_metadata() != SCHEMA:
        return {}
    table = table.replace_schema_metadata()
    return {device: (table.slice(at, 1), rests_on) for at, (device, rests_on) in enumerate(basis)}


def population(rows: pa.Table | Iterable[pa.Table]) -> dict[str, Any]:
    """What the devices say together: the facts of fleet.json, as `cvg fleet` finds them in the same reports."""
    table = rows if isinstance(rows, pa.Table) else pa.concat_tables([SCHEMA.empty_table(), *rows])
    columns = (table[name].to_pylist() for name in ("device", "reason", "report"))
    facts: dict[str, Any] = json.loads(_cvg.population(list(zip(*columns))))
    return facts
