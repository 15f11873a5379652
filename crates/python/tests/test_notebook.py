"""The script of the book runs, and says what the page says that it says."""

from __future__ import annotations

import pathlib
import subprocess
import sys

BOOK = pathlib.Path(__file__).parents[3] / "docs" / "src"


def test_the_notebook_of_the_book_runs():
    done = subprocess.run([sys.executable, BOOK / "python" / "notebook.py"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for expected in ("nothing is wrong", "unit-07", "answered", "detection_gain_ratio", "deg rms", "bench 3 bench: "):
        assert expected in done.stdout, (expected, done.stdout)


def test_the_page_includes_it():
    assert "{{#include python/notebook.py}}" in (BOOK / "python.md").read_text()
