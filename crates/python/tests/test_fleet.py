"""Fleets: Arrow in and out, on Dask with processes of its own, of which one is killed."""

from __future__ import annotations

import os
import pathlib
import signal

import pyarrow
import pyarrow.compute as pc
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


EFFECT = """
id = "own-cubic"
stage = "readout"

[[parameter]]
name = "own"
unit = "1/V^2"
neutral = 0.0
scale = 1e-3

[map]
"x'" = "x * (1 + 2 * own * abs(x)^2)"
"y'" = "y * (1 + 2 * own * abs(y)^2)"
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
    answer, asked = fleet.identify_device, []

    def counted(table, **options):
        if len(asked) == 4:
            raise KeyboardInterrupt
        asked.append(table["device"][0].as_py())
        return answer(table, **options)

    def counted_on(table, **options):
        asked.append(table["device"][0].as_py())
        return answer(table, **options)

    monkeypatch.setattr(fleet, "identify_device", counted)
    with pytest.raises(KeyboardInterrupt):
        fleet.identify_lake(path, out)
    assert pyarrow.parquet.read_table(out)["device"].to_pylist() == asked
    monkeypatch.setattr(fleet, "identify_device", counted_on)
    rows = fleet.identify_lake(path, out)
    assert sorted(asked) == fleet.names(path), "each once"
    written = out.read_bytes()
    assert fleet.identify_lake(path, out).equals(rows) and len(asked) == DEVICES - 1 and out.read_bytes() == written
    monkeypatch.undo()
    assert rows.equals(pyarrow.parquet.read_table(out)) and rows.equals(fleet.identify_table(lake))


def test_an_answer_is_kept_only_where_it_is_to_the_same_question(lake, tmp_path, monkeypatch):
    path, out = tmp_path / "lake.parquet", tmp_path / "answers.parquet"
    few = lake.filter(pc.is_in(lake["device"], pyarrow.array(["unit-00", "unit-01", "unit-02"])))
    pyarrow.parquet.write_table(few, path)
    fleet.identify_lake(path, out)
    answer, asked = fleet.identify_device, []
    monkeypatch.setattr(fleet, "identify_device", lambda t, **o: asked.append(t["device"][0].as_py()) or answer(t, **o))
    # other options
    effect = tmp_path / "own.toml"
    effect.write_text(EFFECT)
    options = {"device": "another"}, {"effects": [effect]}
    for option in options:
        rows = fleet.identify_lake(path, out, **option)
        assert asked == ["unit-00", "unit-01", "unit-02"], option
        asked.clear()
        assert fleet.identify_lake(path, out, **option).equals(rows) and not asked, "kept"
    # a file of the same name that says something else
    effect.write_text(EFFECT.replace("2 *", "3 *"))
    fleet.identify_lake(path, out, effects=[effect])
    assert len(asked) == 3
    asked.clear()
    # other rows of one device, another device gone
    fleet.identify_lake(path, out)
    asked.clear()
    changed = few.filter(pc.not_equal(few["device"], "unit-02"))
    changed = pyarrow.concat_tables([changed.slice(0, 100), changed.slice(101)])
    pyarrow.parquet.write_table(changed, path)
    assert fleet.identify_lake(path, out)["device"].to_pylist() == ["unit-00", "unit-01"] and asked == ["unit-00"]
    asked.clear()
    # another version, and another build of it
    for name, value in (("__version__", "0.0.0"), ("__file__", str(effect))):
        monkeypatch.setattr(fleet._cvg, name, value)
        fleet.identify_lake(path, out)
        assert asked == ["unit-00", "unit-01"], name
        asked.clear()
    # what is not of ours
    pyarrow.parquet.write_table(pyarrow.table({"device": ["unit-00"]}), out)
    assert len(fleet.identify_lake(path, out)) == 2


def test_devices_have_names_of_any_type(lake, tmp_path):
    few = lake.filter(pc.is_in(lake["device"], pyarrow.array(["unit-00", "unit-01"])))
    second = pc.equal(few["device"], "unit-01")
    numbers = pc.if_else(second, 11, 9)
    for kind, names in {
        "int": (numbers, ["11", "9"]),
        "float": (pc.cast(numbers, pyarrow.float64()), ["11", "9"]),
        "dictionary": (few["device"].dictionary_encode(), ["unit-00", "unit-01"]),
        "null": (pc.if_else(second, None, few["device"]), ["", "unit-00"]),
        "large": (pc.cast(few["device"], pyarrow.large_string()), ["unit-00", "unit-01"]),
        # what polars hands out
        "view": (pc.cast(few["device"], pyarrow.string_view()), ["unit-00", "unit-01"]),
    }.items():
        column, expected = names
        path, out = tmp_path / f"{kind}.parquet", tmp_path / f"{kind}-answers.parquet"
        pyarrow.parquet.write_table(few.set_column(few.schema.get_field_index("device"), "device", column), path)
        assert fleet.names(path) == expected, kind
        rows = fleet.identify_lake(path, out).to_pylist()
        alone = fleet.identify_table(pyarrow.parquet.read_table(path)).sort_by("device").to_pylist()
        assert alone == sorted(rows, key=lambda row: row["device"]), kind
        assert [row["device"] for row in rows] == expected, kind
        for row in rows:
            if row["device"]:
                assert row["status"] == "answered", (kind, row["reason"])
            else:
                assert "rows have no `device`" in row["reason"]


def test_a_lake_is_not_written_over_and_answers_are_no_part_of_it(lake, tmp_path):
    few = lake.filter(pc.equal(lake["device"], "unit-00"))
    folder = tmp_path / "lake"
    folder.mkdir()
    path = folder / "lake.parquet"
    pyarrow.parquet.write_table(few, path)
    before = path.read_bytes()
    os.link(path, tmp_path / "linked.parquet")
    for source, out in ((path, path), (path, tmp_path / "linked.parquet"), (folder, folder / "answers.parquet"), (folder, path)):
        with pytest.raises(cvg.InputError, match="is a part of the lake") as raised:
            fleet.identify_lake(source, out)
        assert raised.value.file == str(out) and path.read_bytes() == before
    assert os.listdir(folder) == ["lake.parquet"]


def test_a_lake_in_zstandard_is_answered_here_and_refused_by_the_command_with_a_way_out(lake, cli, tmp_path):
    one = lake.filter(pc.equal(lake["device"], "unit-00"))
    path = tmp_path / "lake.parquet"
    for codec, status in (("zstd", 2), ("snappy", 0)):
        pyarrow.parquet.write_table(one, path, compression=codec)
        assert fleet.identify_lake(path, tmp_path / "answers.parquet")["status"].to_pylist() == ["answered"]
        said = cli.said("fleet", path, "--out", tmp_path / codec, status=status).stderr.decode()
        assert ("is compressed with ZSTD" in said and "wanted no compression, SNAPPY" in said) == (status == 2), said


def test_a_table_of_any_library_is_one(lake):
    import polars

    few = lake.filter(pc.is_in(lake["device"], pyarrow.array(["unit-00", "unit-01"])))
    expected = fleet.identify_table(few)
    for table in (polars.from_arrow(few), few.to_pandas(), few.combine_chunks().to_batches()[0]):
        assert fleet.identify_table(table).equals(expected), type(table)
    [first, _] = fleet.devices(polars.from_arrow(few))
    assert fleet.identify_device(first[1]).equals(expected.slice(0, 1))


def test_a_wrong_call_is_an_error_and_no_row(lake, tmp_path):
    path, out = tmp_path / "lake.parquet", tmp_path / "answers.parquet"
    one = lake.filter(pc.equal(lake["device"], "unit-00"))
    pyarrow.parquet.write_table(one, path)
    calls = (
        lambda **options: fleet.identify_device(one, **options),
        lambda **options: fleet.identify_table(one, **options),
        lambda **options: fleet.identify_lake(path, out, **options),
    )
    for call in calls:
        with pytest.raises(TypeError, match="`colour` is no option of a fleet"):
            call(colour=1)
        with pytest.raises(TypeError, match="`campaign` is no option"):
            call(campaign={"carrier_hz": 15200.0})
        with pytest.raises(cvg.InputError, match="limits"):
            call(limits={"angular_gain.value": {"max": 1.0}})
    # what an answer is kept by has to be told from another
    with pytest.raises(cvg.InputError, match="holdout: Table is no path"):
        fleet.identify_lake(path, out, holdout=one)
    with pytest.raises(cvg.InputError, match="nowhere.toml: cannot be read"):
        fleet.identify_lake(path, out, effects="nowhere.toml")
    lists = one.drop_columns("device").append_column("device", pyarrow.array([[1]] * len(one)))
    for table, what in ((one.drop_columns("device"), "no column `device`"), (lists, "is of the type list")):
        pyarrow.parquet.write_table(table, path)
        with pytest.raises(cvg.InputError, match=what):
            fleet.identify_lake(path, out)
        with pytest.raises(cvg.InputError, match=what):
            fleet.identify_table(table)
    assert not out.exists()
    assert fleet.population([])["devices"] == 0


def test_rows_that_cannot_be_one_device_are_a_row_that_says_so(lake):
    [row] = fleet.identify_device(lake).to_pylist()
    assert row["status"] == "refused" and "`device` has 11 values" in row["reason"]
    [row] = fleet.identify_device({"t_s": [0.0, 1.0]}).to_pylist()
    assert row["status"] == "refused" and "rotation" in row["reason"] or "recording" in row["reason"]
    for nothing in ([1, 2], None, 5):
        [row] = fleet.identify_device(nothing).to_pylist()
        assert row["status"] == "refused" and "is no table" in row["reason"]
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
