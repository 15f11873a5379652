"""Find, explain and remove the angle errors of whole-angle gyroscopes and sin/cos sensors.

    report = cvg.identify(frame)              # a frame, an Arrow table, a dict of arrays, paths, or a list of runs
    print(report)
    clean = report.calibration.compensate(frame)

The answers are those of the command `cvg`, byte for byte.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from . import _cvg
from ._cvg import Instrument, Simulation, Table, __version__
from ._errors import Error, InputError, NoAnswer
from ._input import Data, Limits, Map, Path, Run, entries, is_path, paths, runs, several, text
from ._input import limits as _limits
from ._report import Calibration, Parameter, Report, Verdict

__all__ = [
    "Calibration",
    "Error",
    "InputError",
    "Instrument",
    "NoAnswer",
    "Parameter",
    "Report",
    "Run",
    "Simulation",
    "Table",
    "Verdict",
    "__version__",
    "effects",
    "identify",
    "inspect",
    "simulate",
]


def identify(
    x: Any,
    *,
    map: Map = None,
    holdout: Any = (),
    settle: float | None = None,
    sensor: bool = False,
    device: str | None = None,
    name: str | None = None,
    campaign: Mapping[str, object] | None = None,
    effects: Path | Iterable[Path] = (),
    limits: Limits = None,
    progress: Callable[[str], object] | None = None,
) -> Report:
    """Identifies an instrument.

    `x` is a campaign.toml, a recording's path or several of them; a frame of pandas or polars, an Arrow table, a mapping
    of column names to arrays, or several of these; a list of `Run`, where runs differ in kind; or a `Simulation`.

    `map`, `holdout`, `settle`, `sensor` and `effects` are the options of `cvg identify`. `name` is what a frame is called in
    the report, `device` the instrument. `campaign` holds keys of a campaign file's table `campaign`, such as
    `{"carrier_hz": 15200.0}`. `limits` is a limits file, or what it says as a mapping,
    `{"heldout.discovered.rms_deg": {"max": 0.01}}`: `report.verdicts` has the command's, and nothing is raised where one
    fails. `progress` is told what is going on. Other threads of Python run meanwhile, and a
    KeyboardInterrupt ends it.

    Raises `InputError` where the input has to be mended, `NoAnswer` where it does not carry one.
    """
    files = paths(several(effects) if is_path(effects) else list(effects))  # type: ignore[arg-type]
    options = (entries(map), settle, sensor, device, files, *_limits(limits), progress)
    if isinstance(x, Simulation):
        return Report(_cvg.identify_runs(x.recordings, 0, x.campaign_toml, *options))
    given, held = several(x), several(holdout)
    if not given:
        raise InputError("there is nothing to identify; wanted recordings")
    if all(is_path(item) for item in given + held):
        if campaign is not None:
            raise InputError("campaign: recordings on disk have a campaign.toml to say it in")
        if name is not None:
            raise InputError("name: recordings on disk have names")
        return Report(_cvg.identify_files(paths(given), paths(held), *options))
    if any(is_path(item) for item in given + held):
        raise InputError("recordings on disk and in memory cannot be mixed; wanted one or the other")
    if name is not None:
        if len(given) + len(held) > 1:
            raise InputError("name: there are several recordings; wanted cvg.Run(data, name=…) for each")
        given = [Run(given[0], name)] if not isinstance(given[0], Run) else given
    fitted = runs(given)
    withheld = runs(held, len(fitted) + 1)
    every = fitted + withheld
    names = [run.name for run in every]
    if len(set(names)) < len(names):
        raise InputError("two recordings have one name; wanted a name of its own for each")
    pairs = [(str(run.name), run.data) for run in every]
    if campaign is None and all(run.is_plain() for run in every):
        return Report(_cvg.identify_runs(pairs, len(withheld), None, *options))
    if settle is not None:
        raise InputError("settle: runs say themselves how long they settle, by settle_s")
    head = {"device": "recordings", **(campaign or {})}
    marked = fitted + [Run(**{**run.__dict__, "holdout": True}) for run in withheld]
    return Report(_cvg.identify_runs(pairs, 0, text(head, marked), *options))


def inspect(x: Any, *, map: Map = None, name: str = "recording") -> list[dict[str, Any]]:
    """What is in recordings, and what is wrong with them; `x` is as in `identify`."""
    given = several(x)
    if not given:
        raise InputError("there is nothing to inspect; wanted recordings")
    if any(is_path(item) for item in given) and not all(is_path(item) for item in given):
        raise InputError("recordings on disk and in memory cannot be mixed; wanted one or the other")
    if is_path(given[0]):
        said = _cvg.inspect_files(paths(given), entries(map))
    else:
        every = runs([Run(given[0], name)] if len(given) == 1 and not isinstance(given[0], Run) else given)
        said = _cvg.inspect_runs([(str(run.name), run.data) for run in every], entries(map))
    facts: list[dict[str, Any]] = json.loads(said)
    return facts


def effects() -> list[dict[str, Any]]:
    """The library of effects: what a recording can hold."""
    library: list[dict[str, Any]] = json.loads(_cvg.effects())
    return library


def simulate(scenario: Path) -> Simulation:
    """Simulates a scenario, given as a path or as its text (TOML)."""
    if not is_path(scenario):
        raise TypeError(f"{type(scenario).__name__} is no scenario; wanted a path, or its text")
    said = os.fspath(scenario)
    if "\n" in said:
        return _cvg.simulate(said, "scenario")
    try:
        with open(said, encoding="utf-8") as file:
            return _cvg.simulate(file.read(), said)
    except OSError as error:
        raise InputError(f"{said}: cannot be read: {error.strerror}", said) from None
    except UnicodeDecodeError:
        raise InputError(f"{said}: is no text in UTF-8; wanted a scenario", said) from None
