"""Answers: reports and calibrations."""

from __future__ import annotations

import html
import json
import os
from typing import Any, NamedTuple

from . import _cvg
from ._input import Data, Map, Path, entries, like
from ._travel import Answer


class Parameter(NamedTuple):
    """A number of a report: its place, keys joined by dots, and its 95 % interval where it has one."""

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None


class Verdict(NamedTuple):
    """A number of a report, held against its limit; `line` is what the command says of it."""

    name: str
    #: none where the report does not tell it, which does not pass
    value: float | None
    min: float | None
    max: float | None
    passes: bool
    line: str

    def __str__(self) -> str:
        return self.line


class Calibration:
    """What undoes the errors of an instrument; calibration.toml."""

    def __init__(self, native: _cvg.Calibration) -> None:
        self._native = native

    @classmethod
    def read(cls, path: Path) -> Calibration:
        """Reads calibration.toml."""
        return cls(_cvg.Calibration.read(os.fspath(path)))

    @classmethod
    def from_text(cls, text: str) -> Calibration:
        """The calibration that a text says."""
        return cls(_cvg.Calibration.from_text(text))

    @property
    def device(self) -> str:
        """The instrument."""
        return self._native.device

    @property
    def left_out(self) -> list[str]:
        """Effects of the table or of one recording's clock, which are not undone in another recording."""
        return self._native.left_out

    def to_text(self) -> str:
        """calibration.toml, as `cvg identify` writes it."""
        return self._native.to_text()

    def save(self, path: Path) -> None:
        """Writes calibration.toml."""
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(self.to_text())

    def compensate(self, data: Data, *, map: Map = None, name: str = "recording") -> Any:
        """The recording with the errors taken out, as the kind of frame that `data` is. What is doubtful is a warning."""
        import warnings

        table, said = self._native.compensate(data, name, entries(map))
        for warning in said:
            warnings.warn(warning, stacklevel=2)
        return like(table, data)

    def __repr__(self) -> str:
        return f"<cvg.Calibration of {self.device}>"

    def __reduce__(self) -> tuple[object, ...]:
        return (Calibration.from_text, (self.to_text(),))


class Report:
    """What a campaign told. The facts of report.json are attributes: `report.heldout["discovered"]["rms_deg"]`."""

    def __init__(self, native: _cvg.Report | Answer) -> None:
        self._native = native
        self._facts: dict[str, Any] | None = None

    def __reduce__(self) -> tuple[object, ...]:
        native = self._native
        return (Report, (native if isinstance(native, Answer) else Answer.of(native),))

    def __copy__(self) -> Report:
        # what is behind it never changes
        return Report(self._native)

    def __deepcopy__(self, memo: object) -> Report:
        return Report(self._native)

    def to_json(self) -> str:
        """report.json, byte for byte that of `cvg identify`."""
        return self._native.to_json()

    def to_dict(self) -> dict[str, Any]:
        """The facts of report.json."""
        facts: dict[str, Any] = json.loads(self.to_json())
        return facts

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if self._facts is None:
            self._facts = self.to_dict()
        try:
            return self._facts[name]
        except KeyError:
            known = ", ".join(self._facts)
            raise AttributeError(f"the report has no `{name}`; it has {known}") from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.to_dict()})

    @property
    def parameters(self) -> list[Parameter]:
        """Each number that was told, with its interval."""
        return [Parameter(*p) for p in self._native.parameters()]

    @property
    def verdicts(self) -> list[Verdict]:
        """Each limit that was asked for, in the order of the command's lines."""
        return [Verdict(*v) for v in self._native.verdicts()]

    @property
    def is_within_limits(self) -> bool | None:
        """Whether every limit holds; none where none was asked for."""
        verdicts = self.verdicts
        return all(v.passes for v in verdicts) if verdicts else None

    def to_frame(self) -> Any:
        """The parameters as a frame of pandas, or of polars where that alone is there."""
        columns = dict(zip(Parameter._fields, map(list, zip(*self.parameters))))
        try:
            import pandas
        except ImportError:
            import polars

            return polars.DataFrame(columns)
        return pandas.DataFrame(columns, columns=list(Parameter._fields))

    @property
    def calibration(self) -> Calibration | None:
        """What undoes what was found; none where nothing was."""
        native = self._native.calibration()
        return None if native is None else Calibration(native)

    def residuals(self) -> _cvg.Table:
        """What is left of the angle over time: `run`, `t_s`, `error_deg`, thinned to what a figure shows."""
        return self._native.residuals()

    def bias(self) -> _cvg.Table:
        """The held-out angle error over the pattern angle: `run`, `pattern_deg`, and the error raw, after the declared
        model and after all, deg; thinned to what a figure shows."""
        return self._native.bias()

    def html(self) -> str:
        """report.html"""
        return self._native.html()

    def save(self, folder: Path) -> None:
        """Writes report.json, report.html and, where there is one, calibration.toml."""
        os.makedirs(folder, exist_ok=True)
        for name, text in (("report.json", self.to_json()), ("report.html", self.html())):
            with open(os.path.join(folder, name), "w", encoding="utf-8", newline="") as file:
                file.write(text)
        if self.calibration is not None:
            self.calibration.save(os.path.join(folder, "calibration.toml"))

    def _repr_html_(self) -> str:
        # a page of its own: its style and scripts stay within it
        page = html.escape(self.html(), quote=True)
        return f'<iframe sandbox="allow-scripts" style="width:100%;height:44rem;border:0" srcdoc="{page}"></iframe>'

    def __str__(self) -> str:
        return self._native.summary()

    def __repr__(self) -> str:
        return f"<cvg.Report of {self.device}: {self.status}>"
