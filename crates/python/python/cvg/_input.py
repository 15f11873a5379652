"""What a recording may be, and how a campaign is said in a call."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat, SupportsIndex, Union

from ._errors import InputError

Path = Union[str, "os.PathLike[str]"]
#: a frame of pandas or polars, an Arrow table, or columns by their names
Data = Any
#: which column is which channel: {"t_s": "Time (ms)*0.001"}, or "t_s=Time (ms)*0.001" one by one
Map = Union[Mapping[str, str], Iterable[str], None]
#: a limits file, or what it says: {"heldout.discovered.rms_deg": {"max": 0.01}}
Limits = Union[Path, Mapping[str, Mapping[str, float]], None]


@dataclass(frozen=True)
class Run:
    """A recording in memory and what was done in it; the words are those of a campaign file."""

    data: Data
    name: str | None = None
    kind: str = "rotation"
    settle_s: float | None = None
    holdout: bool = False
    amplitude: float | None = None
    angle_deg: float | None = None
    energy_off_s: float | None = None
    rate_dps: float | None = None

    def is_plain(self) -> bool:
        """Whether it is a rotation of which nothing else is said."""
        others = (self.settle_s, self.amplitude, self.angle_deg, self.energy_off_s, self.rate_dps)
        return self.kind == "rotation" and not self.holdout and all(value is None for value in others)


def is_path(x: object) -> bool:
    return isinstance(x, (str, os.PathLike))


def several(x: object) -> list[Any]:
    """What is one or a list of them."""
    if x is None:
        return []
    if isinstance(x, (list, tuple)):
        return list(x)
    return [x]


def paths(x: Iterable[Path]) -> list[str]:
    return [os.fspath(path) for path in x]


def entries(columns: Map) -> list[str]:
    """The mapping as the command line says it."""
    if columns is None:
        return []
    if isinstance(columns, Mapping):
        for channel, column in columns.items():
            if not isinstance(column, str):
                raise InputError(f"map: `{channel}` is mapped to {column!r}; wanted a column's name, as in 'Time*0.001'")
        return [f"{channel}={column}" for channel, column in columns.items()]
    if isinstance(columns, str):
        return [columns]
    return list(columns)


def limits(x: Limits) -> tuple[str | None, str | None]:
    """Limits as a file, or as the text of one."""
    if x is None:
        return None, None
    if isinstance(x, Mapping):
        if not all(isinstance(ends, Mapping) for ends in x.values()):
            raise InputError("limits: wanted a mapping with min, max or both for each number of the report")
        lines = (f"{_toml(place)} = {_inline(ends)}" for place, ends in x.items())
        return None, "\n".join(lines)
    return os.fspath(x), None


def _inline(ends: Mapping[str, float]) -> str:
    return "{ " + ", ".join(f"{_toml(end)} = {_number(value)}" for end, value in ends.items()) + " }"


def _number(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, SupportsFloat):
        return _toml(str(value))
    return repr(float(value))


def runs(x: Sequence[object], first: int = 1) -> list[Run]:
    """Runs with names: their own, or numbers where there are several."""
    alone = len(x) == 1 and first == 1
    made = [item if isinstance(item, Run) else Run(item) for item in x]
    out = []
    for number, run in enumerate(made, first):
        name = run.name or ("recording" if alone else f"recording-{number}")
        out.append(Run(**{**run.__dict__, "name": name}))
    return out


def _toml(value: object) -> str:
    # numpy's numbers are numbers as well
    if not isinstance(value, bool) and isinstance(value, SupportsIndex):
        return repr(value.__index__())
    if not isinstance(value, bool) and isinstance(value, SupportsFloat):
        return repr(float(value))
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    # strings and truth values are written alike in JSON and TOML
    try:
        return json.dumps(value, ensure_ascii=False)
    except TypeError:
        raise InputError(f"campaign: {value!r} is no value of a campaign; wanted a text or a number") from None


def text(campaign: Mapping[str, object], recordings: Sequence[Run]) -> str:
    """The campaign file that says this."""
    lines = ["[campaign]"]
    lines += [f"{key} = {_toml(value)}" for key, value in campaign.items() if value is not None]
    for run in recordings:
        said = {
            "kind": run.kind,
            "file": run.name,
            "settle_s": run.settle_s,
            "use": "holdout" if run.holdout else None,
            "amplitude": run.amplitude,
            "angle_deg": run.angle_deg,
            "energy_off_s": run.energy_off_s,
            "rate_dps": run.rate_dps,
        }
        lines += ["", "[[run]]"]
        lines += [f"{key} = {_toml(value)}" for key, value in said.items() if value is not None]
    return "\n".join(lines) + "\n"


def like(table: Any, pattern: Any) -> Any:
    """A table as what `pattern` is: of pandas, with its index, polars or pyarrow, or a dict of arrays."""
    library = type(pattern).__module__.split(".")[0]
    if library == "pandas":
        import pandas

        frame = pandas.DataFrame(table.to_dict())
        # where rows were left out, nobody says which
        return frame.set_axis(pattern.index, axis=0) if len(frame) == len(pattern) else frame
    if library == "polars":
        import polars

        return polars.DataFrame(table)
    if library == "pyarrow":
        import pyarrow

        return pyarrow.table(table)
    return table.to_dict() if isinstance(pattern, Mapping) else table
