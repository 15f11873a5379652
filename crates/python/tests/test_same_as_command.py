"""The answers of the module are those of the command, byte for byte."""

from __future__ import annotations

import pathlib

import numpy
import pandas
import polars
import pyarrow
import pyarrow.csv
import pytest

import cvg

NAME = "standard input"


def frame(folder: pathlib.Path, name: str) -> pyarrow.Table:
    return pyarrow.csv.read_csv(folder / name)


def test_a_campaign_on_disk_gives_the_bytes_of_the_command(folder, cli, tmp_path):
    campaign = folder / "campaign.toml"
    report = cvg.identify(campaign)
    assert report.to_json() + "\n" == cli("identify", campaign, "--json")
    cli("identify", campaign, "--out", tmp_path / "cli")
    report.save(tmp_path / "module")
    for name in ("report.json", "report.html", "calibration.toml"):
        assert (tmp_path / "module" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes(), name


def test_every_kind_of_frame_gives_the_bytes_of_the_command_on_the_same_numbers(folder, cli):
    table = frame(folder, "rot+500.csv")
    expected = cli("identify", "-", "--json", stdin=(folder / "rot+500.csv").read_bytes())
    arrays = {name: table[name].to_numpy() for name in table.column_names}
    # in reverse, so that the arrays are no block of memory
    strided = {name: values[::-1].copy()[::-1] for name, values in arrays.items()}
    kinds = {
        "pyarrow": table,
        "chunks": pyarrow.concat_tables([table.slice(0, 300), table.slice(300)]),
        "pandas": table.to_pandas(),
        "pandas, selected": (lambda f: f[f.index >= 0].set_index(f.index[::-1]))(table.to_pandas()),
        "polars": polars.from_arrow(table),
        "arrays": arrays,
        "strided arrays": strided,
        "lists": {name: list(values) for name, values in arrays.items()},
    }
    for kind, data in kinds.items():
        assert cvg.identify(data, name=NAME).to_json() + "\n" == expected, kind


def test_a_mapping_and_the_options_are_those_of_the_command(folder, cli):
    table = frame(folder, "rot+500.csv")
    foreign = table.rename_columns(["Time (ms)" if n == "t_s" else f"Ch {n}" for n in table.column_names])
    at = foreign.column_names.index("Time (ms)")
    foreign = foreign.set_column(at, "Time (ms)", pyarrow.array(foreign["Time (ms)"].to_numpy() * 1e3))
    names = [n for n in table.column_names if n != "t_s"]
    mapping = {"t_s": "Time (ms)*0.001"} | {n: f"Ch {n}" for n in names}
    text = "\n".join([",".join(foreign.column_names), *(",".join(map(repr, r.values())) for r in foreign.to_pylist()), ""])
    options = [o for channel, column in mapping.items() for o in ("--map", f"{channel}={column}")]
    expected = cli("identify", "-", "--json", "--settle", "1.5", *options, stdin=text.encode())
    assert cvg.identify(foreign, map=mapping, settle=1.5, name=NAME).to_json() + "\n" == expected
    listed = [f"{channel}={column}" for channel, column in mapping.items()]
    assert cvg.identify(foreign, map=listed, settle=1.5, name=NAME).to_json() + "\n" == expected


def test_runs_in_memory_are_answered_as_the_campaign_that_they_are_of(folder):
    runs = [
        cvg.Run(frame(folder, "rot+500.csv"), "rot+500.csv", settle_s=1.0),
        cvg.Run(frame(folder, "rot-300.csv").to_pandas(), "rot-300.csv", settle_s=1.0),
        cvg.Run(frame(folder, "ring.csv"), "ring.csv", kind="ringdown", angle_deg=20.0, energy_off_s=energy_off(folder)),
    ]
    head = {"device": "unit-07", "carrier_hz": 15200.0, "angular_gain": 0.8}
    memory, disk = cvg.identify(runs, campaign=head).to_dict(), cvg.identify(folder / "campaign.toml").to_dict()
    # what was never a file has no checksum
    assert all(i["crc32"] is None for i in memory.pop("inputs")) and all(i["crc32"] for i in disk.pop("inputs"))
    assert memory == disk
    simulated = cvg.identify(cvg.simulate(__import__("conftest").SCENARIO))
    assert simulated.detection_gain_ratio["value"] == pytest.approx(disk["detection_gain_ratio"]["value"], abs=1e-6)


def energy_off(folder: pathlib.Path) -> float:
    lines = (folder / "campaign.toml").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("energy_off_s")).split("=")[1])


def test_compensation_effects_and_inspection_are_those_of_the_command(folder, cli, tmp_path):
    import json

    calibration = cvg.identify(folder / "campaign.toml").calibration
    assert calibration is not None
    calibration.save(tmp_path / "calibration.toml")
    again = cvg.Calibration.read(tmp_path / "calibration.toml")
    assert again.to_text() == calibration.to_text()
    recording = folder / "rot+500.csv"
    cli("compensate", tmp_path / "calibration.toml", recording, "--out", tmp_path / "clean.csv")
    expected = pyarrow.csv.read_csv(tmp_path / "clean.csv").to_pandas().astype(float)
    frames = frame(folder, "rot+500.csv")
    clean = again.compensate(frames.to_pandas())
    pandas.testing.assert_frame_equal(clean, expected, check_exact=True)
    assert isinstance(again.compensate(polars.from_arrow(frames)), polars.DataFrame)
    assert isinstance(again.compensate(frames), pyarrow.Table)
    arrays = again.compensate({n: frames[n].to_numpy() for n in frames.column_names})
    numpy.testing.assert_array_equal(arrays["theta_deg"], expected["theta_deg"])
    assert cvg.effects() == json.loads(cli("effects", "--json"))
    assert cvg.inspect(recording) == json.loads(cli("inspect", recording, "--json"))
    [inside] = cvg.inspect(frames, name=str(recording))
    assert inside == cvg.inspect(recording)[0]


def test_limits_have_the_verdicts_of_the_command_line_by_line(folder, cli, tmp_path):
    said = {
        "heldout.discovered.rms_deg": {"max": 0.01},
        "angular_gain.value": {"max": numpy.float64(0.7)},
        "detection_gain_ratio.value": {"min": 0.97, "max": 1.03},
        "runs.rot+500.csv.spikes": {"max": 3},
        "allan.bias_instability_dph.value": {"max": 1.0},
    }
    file = tmp_path / "limits.toml"
    numbers = {place: ", ".join(f"{end} = {float(v)}" for end, v in ends.items()) for place, ends in said.items()}
    file.write_text("".join(f'"{place}" = {{ {ends} }}\n' for place, ends in numbers.items()))
    expected = cli.said("identify", folder / "campaign.toml", "--json", "--limits", file, status=1)
    lines = [line for line in expected.stderr.decode().splitlines() if line[:4] in ("pass", "FAIL")]
    for limits in (file, str(file), said):
        report = cvg.identify(folder / "campaign.toml", limits=limits)
        assert report.to_json() + "\n" == expected.stdout.decode()
        assert sorted(map(str, report.verdicts)) == sorted(lines) and len(lines) == len(said)
        assert report.is_within_limits is False
    of_file = cvg.identify(folder / "campaign.toml", limits=file).verdicts
    assert [str(verdict) for verdict in of_file] == lines
    kept = cvg.identify(frame(folder, "rot+500.csv"), limits={"angular_gain.value": {"min": 0.7, "max": 0.9}})
    assert kept.is_within_limits is True and kept.verdicts[0].value == kept.angular_gain["value"]
    assert cvg.identify(frame(folder, "rot+500.csv")).is_within_limits is None


def test_limits_that_cannot_be_meant_are_errors_with_the_words_of_the_command(folder, cli, tmp_path):
    file = tmp_path / "limits.toml"
    for text, part in (
        ('"heldout.discovered.rms" = { max = 1 }\n', "names no number of the report"),
        ('"angular_gain.value" = { min = 1, max = 0 }\n', "min is above max"),
        ("", "there is no limit"),
    ):
        file.write_text(text)
        said = cli.said("identify", folder / "campaign.toml", "--limits", file, status=2).stderr.decode()
        with pytest.raises(cvg.InputError, match=part) as raised:
            cvg.identify(folder / "campaign.toml", limits=file)
        assert str(raised.value) in said
    for wrong in ({}, {"angular_gain.value": {"max": "1"}}, {"angular_gain.value": {"max": True}}, {"angular_gain.value": 1.0}):
        with pytest.raises(cvg.InputError, match="limits"):
            cvg.identify(folder / "campaign.toml", limits=wrong)
