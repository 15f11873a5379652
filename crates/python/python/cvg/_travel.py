"""What travels between processes, pickled: answers as the texts and tables that they hold, simulations as their scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from . import _cvg


@dataclass(frozen=True)
class Answer:
    """An answer from another process: all that a report says, with nothing left to work out."""

    json: str
    page: str
    words: str
    numbers: list[tuple[str, str, float, float | None, float | None]]
    judged: list[tuple[str, float | None, float | None, float | None, bool, str]]
    undone: str | None
    left: _cvg.Table
    curves: _cvg.Table

    @classmethod
    def of(cls, native: _cvg.Report) -> Answer:
        calibration = native.calibration()
        return cls(
            native.to_json(),
            native.html(),
            native.summary(),
            native.parameters(),
            native.verdicts(),
            None if calibration is None else calibration.to_text(),
            native.residuals(),
            native.bias(),
        )

    def to_json(self) -> str:
        return self.json

    def html(self) -> str:
        return self.page

    def summary(self) -> str:
        return self.words

    def parameters(self) -> list[tuple[str, str, float, float | None, float | None]]:
        return self.numbers

    def verdicts(self) -> list[tuple[str, float | None, float | None, float | None, bool, str]]:
        return self.judged

    def calibration(self) -> _cvg.Calibration | None:
        return None if self.undone is None else _cvg.Calibration.from_text(self.undone)

    def residuals(self) -> _cvg.Table:
        return self.left

    def bias(self) -> _cvg.Table:
        return self.curves


def table(columns: list[tuple[str, Any]]) -> _cvg.Table:
    """A table of arrays and lists of texts."""
    return _cvg.Table.of(columns)


def simulation(scenario: str, name: str) -> _cvg.Simulation:
    """A simulation, made again: the same scenario gives the same bytes."""
    return _cvg.simulate(scenario, name)
