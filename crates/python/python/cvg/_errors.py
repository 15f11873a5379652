"""What goes wrong, with the place where it did."""

from __future__ import annotations


class Error(Exception):
    """What `cvg` raises."""


class InputError(Error, ValueError):
    """The input is not what it should be: mend the file, the frame or the call.

    `file`, `line`, `row` and `column` say where, as far as it is known; all but `file` count from 1. Lines are of text,
    rows of Parquet, arrays and frames.
    """

    def __init__(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        row: int | None = None,
        column: int | None = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.row = row
        self.column = column

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (str(self), self.file, self.line, self.row, self.column))


class NoAnswer(Error):
    """The input is sound and does not carry an answer; `json` is the report that says so, where there is one."""

    def __init__(self, message: str, json: str | None = None) -> None:
        super().__init__(message)
        self.json = json

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (str(self), self.json))
