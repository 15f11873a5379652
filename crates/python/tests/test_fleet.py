"""Fleets: Arrow in and out, on Dask with processes of its own, of which one is killed."""

from __future__ import annotations

import os
import pathlib
import signal

import pyarrow
import pyarrow.csv
import pyarrow.parquet
import pytest

import cvg
from cvg import fleet

DEVICES = 12
SCENARIO = """
device = "unit-{number:02}"
angular_gain = 0.78
noise_v = 2e-5
tau_s = 10.0
seed = {number}
sample_hz = 200.0
effects = [ {{ id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 }} ]
run = [
  {{ kind = "rotation", file = "forth.csv", rate_dps = 500.0, duration_s = 8.0, settle_s = 0.5 }},
  {{ kind = "rotation", file = "back.csv", rate_dps = -300.0, duration_s = 8.0, settle_s = 0.5 }},
]
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    root = tmp_path_factory.mktemp("fleet")
    for number in range(DEVICES):
        cvg.simulate(SCENARIO.format(number=number)).write(root / f"unit-{number:02}")
    # a device that fails is a row
    (root / "unit-03" / "forth.csv").write_text("t_s,rate_dps,theta_deg\n0,1,x\n")
    return root


@pytest.fixture(scope="module")
def lake(folders) -> pyarrow.Table:
    """All devices in one table."""
    parts = []
    for number in range(DEVICES):
        if number == 3:
            continue
        for name in ("forth.csv", "back.csv"):
            part = pyarrow.csv.read_csv(folders / f"unit-{number:02}" / name)
            for word, value in (("device", f"unit-{number:02}"), ("run", name), ("settle_s", 0.5)):
                part = part.append_column(word, pyarrow.array([value] * len(part)))
            parts.append(part)
    return pyarrow.concat_tables(parts, promote_options="permissive")


def campaigns(folders: pathlib.Path) -> list[str]:
    return [str(folders / f"unit-{number:02}" / "campaign.toml") for number in range(DEVICES)]


def test_a_worker_killed_in_the_middle_changes_no_byte_of_any_device(folders, cli, tmp_path):
    from dask.distributed import Client, LocalCluster, as_completed

    files = campaigns(folders)
    alone = {file: fleet.identify_device(file) for file in files}
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, env={"RAYON_NUM_THREADS": "1"}
        ) as cluster,
        Client(cluster) as client,
    ):
        workers = client.run(os.getpid)
        assert len(set(workers.values()) - {os.getpid()}) == 2
        # the first device that is done has the process end that answers others
        futures = client.map(fleet.identify_device, files, pure=False)
        answered, killed = {}, False
        for future, row in as_completed(futures, with_results=True):
            assert future.key not in answered
            answered[future.key] = row
            if not killed:
                os.kill(next(iter(workers.values())), signal.SIGKILL)
                killed = True
        after = client.run(os.getpid)
    assert len(answered) == DEVICES and set(after.values()) != set(workers.values())
    rows = [answered[future.key] for future in futures]
    for file, row in zip(files, rows):
        assert row.equals(alone[file]), file
    # and as the command gives
    cli("fleet", folders, "--out", tmp_path)
    for number, row in enumerate(rows):
        [device] = row.to_pylist()
        if number == 3:
            assert device["status"] == "refused" and "line 2" in device["reason"]
            continue
        own = tmp_path / f"unit-{number:02}"
        assert device["report"] == (own / "report.json").read_text(encoding="utf-8")
        assert device["calibration"] == (own / "calibration.toml").read_text(encoding="utf-8")


def test_a_table_of_devices_is_answered_as_their_files_are(folders, lake, tmp_path):
    pyarrow.parquet.write_table(lake, tmp_path / "lake.parquet")
    rows = fleet.identify_table(pyarrow.parquet.read_table(tmp_path / "lake.parquet"))
    assert rows.schema == fleet.SCHEMA and len(rows) == DEVICES - 1
    files = [fleet.identify_device(file).to_pylist()[0] for file in campaigns(folders)]
    files = [file for file in files if file["status"] != "refused"]
    for row, file in zip(rows.to_pylist(), files):
        # but for the checksums of files, which a table has none of
        assert {k: row[k] for k in row if k not in ("report", "calibration")} == {
            k: file[k] for k in file if k not in ("report", "calibration")
        }


def test_a_lake_goes_on_where_it_was_broken_off(lake, tmp_path, monkeypatch):
    path, out = tmp_path / "lake.parquet", tmp_path / "answers.parquet"
    pyarrow.parquet.write_table(lake, path)
    assert fleet.names(path) == [f"unit-{n:02}" for n in range(DEVICES) if n != 3]
    answer, asked = fleet.identify_in, []

    def counted(lake, device, **options):
        if len(asked) == 4:
            raise KeyboardInterrupt
        asked.append(device)
        return answer(lake, device, **options)

    monkeypatch.setattr(fleet, "identify_in", counted)
    with pytest.raises(KeyboardInterrupt):
        fleet.identify_lake(path, out)
    assert pyarrow.parquet.read_table(out)["device"].to_pylist() == asked
    monkeypatch.setattr(fleet, "identify_in", lambda *a, **o: asked.append(a[1]) or answer(*a, **o))
    rows = fleet.identify_lake(path, out)
    assert sorted(asked) == fleet.names(path), "each once"
    assert rows.equals(pyarrow.parquet.read_table(out)) and rows.equals(fleet.identify_table(lake))


def test_rows_that_cannot_be_one_device_are_a_row_that_says_so(lake):
    [row] = fleet.identify_device(lake).to_pylist()
    assert row["status"] == "refused" and "`device` has 11 values" in row["reason"]
    [row] = fleet.identify_device({"t_s": [0.0, 1.0]}).to_pylist()
    assert row["status"] == "refused" and "rotation" in row["reason"] or "recording" in row["reason"]
    assert len(fleet.identify_table(lake.slice(0, 0))) == 0


def test_the_population_is_that_of_the_command(folders, cli, tmp_path):
    import json

    cli("fleet", folders, "--out", tmp_path)
    expected = json.loads((tmp_path / "fleet.json").read_text())
    found = fleet.population(fleet.identify_device(file) for file in campaigns(folders))
    assert found["answered"] == DEVICES - 1
    for facts in (expected, found):
        # folders are of the command's results
        for odd in facts["odd"]:
            del odd["folder"]
    assert found == expected
