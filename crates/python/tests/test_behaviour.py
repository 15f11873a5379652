"""What a notebook and a program rely on: errors with their place, interruption, threads, tables, the instrument."""

from __future__ import annotations

import copy
import datetime
import decimal
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
import time

import numpy
import pandas
import polars
import pyarrow
import pytest

import cvg
from conftest import SCENARIO


@pytest.fixture(scope="module")
def report(folder):
    return cvg.identify(folder / "campaign.toml")


def test_an_error_says_file_line_and_column(tmp_path):
    recording = tmp_path / "rot.csv"
    recording.write_text("t_s,rate_dps,theta_deg\n0,10,0\n0.1,10,zero\n0.2,10,2\n")
    with pytest.raises(cvg.InputError) as raised:
        cvg.identify(recording)
    error = raised.value
    assert (error.file, error.line, error.row, error.column) == (str(recording), 3, None, 3)
    assert isinstance(error, ValueError) and "zero" in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.line, again.column) == (str(error), 3, 3)
    campaign = tmp_path / "campaign.toml"
    campaign.write_text("[campaign]\ndevice = 3\n")
    with pytest.raises(cvg.InputError) as raised:
        cvg.identify(campaign)
    assert (raised.value.file, raised.value.line) == (str(campaign), 2)


def test_an_error_says_in_which_of_the_files_that_were_given(folder, tmp_path):
    table = folder / "rot+500.csv"
    broken = tmp_path / "broken.toml"
    broken.write_text("a = 1\nb = = 2\n")
    binary = tmp_path / "binary"
    binary.write_bytes(b"\xff\xfe\x00")
    nowhere = tmp_path / "nowhere.toml"
    for call, file, line in (
        (lambda: cvg.identify(table, limits=broken), broken, 2),
        (lambda: cvg.identify(table, limits=nowhere), nowhere, None),
        (lambda: cvg.identify(table, effects=nowhere), nowhere, None),
        (lambda: cvg.identify(table, effects=broken), broken, None),
        (lambda: cvg.Calibration.read(nowhere), nowhere, None),
        (lambda: cvg.Calibration.read(broken), broken, None),
        (lambda: cvg.simulate(broken), broken, 2),
        (lambda: cvg.simulate(binary), binary, None),
        (lambda: cvg.simulate(nowhere), nowhere, None),
    ):
        with pytest.raises(cvg.InputError) as raised:
            call()
        assert (raised.value.file, raised.value.line) == (str(file), line), str(raised.value)
    assert raised.value.column is None


def test_an_error_of_a_frame_says_its_row():
    back = {"t_s": [0.0, 0.1, 0.2, 0.05], "rate_dps": [10.0] * 4, "theta_deg": [0.0, 1.0, 2.0, 3.0]}
    with pytest.raises(cvg.InputError) as raised:
        cvg.identify(back, name="bench 3")
    assert (raised.value.file, raised.value.row, raised.value.line) == ("bench 3", 4, None)
    with pytest.raises(cvg.InputError, match="map"):
        cvg.identify({"Time": [0.0]})
    for wrong in (7, [], [back, "rot.csv"]):
        with pytest.raises((cvg.InputError, TypeError)):
            cvg.identify(wrong)
    with pytest.raises(cvg.InputError, match="one dimension"):
        cvg.identify(back | {"t_s": numpy.zeros((4, 2))})


def test_a_call_that_cannot_be_meant_says_what_is_wanted(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    wide = polars.from_pandas(table).with_columns(polars.col("rate_dps").cast(polars.Int128))
    for call, what in (
        (lambda: cvg.identify(table, map={"t_s": ("Time", 0.001)}), "map: `t_s` is mapped to"),
        (lambda: cvg.identify(table, campaign={"carrier_hz": [1.0]}), "no value of a campaign|carrier_hz"),
        (lambda: cvg.identify(table, campaign={"device": object()}), "is no value of a campaign"),
        (lambda: cvg.identify(wide), "the stream of Arrow data cannot be read"),
        (lambda: cvg.inspect(None), "nothing to inspect"),
        (lambda: cvg.inspect([table, "rot.csv"]), "cannot be mixed"),
        (lambda: cvg.Instrument(window=-1), "window: wanted"),
        (lambda: cvg.Instrument(window=1 << 16), "window: wanted"),
    ):
        with pytest.raises(cvg.InputError, match=what):
            call()
    with pytest.raises(TypeError, match="bytes is no scenario"):
        cvg.simulate(b"scenario.toml")


def test_numbers_of_numpy_are_numbers_of_a_campaign(folder):
    table = pandas.read_csv(folder / "rot+500.csv")

    def answered(carrier, settle):
        return cvg.identify([cvg.Run(table, "a", settle_s=settle)], campaign={"carrier_hz": carrier}).to_json()

    expected = answered(15200.0, 1.5)
    for number in (numpy.float32, numpy.float64):
        assert answered(number(15200.0), number(1.5)) == expected
    assert answered(numpy.int64(15200), decimal.Decimal("1.5")) == expected


def test_a_mapping_to_a_column_that_is_not_there_scales_no_other(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    report = cvg.identify(table, map={"t_s": "Time*0.001", "xc_v": "A*3"})
    assert [p.value for p in report.parameters] == [p.value for p in cvg.identify(table).parameters]
    assert sum("taken as it is" in warning for warning in report.warnings) == 2


def test_a_compensated_frame_has_the_index_and_the_numbers_that_it_came_with(folder, report):
    table = pandas.read_csv(folder / "rot+500.csv")
    rows = len(table)
    extra = table.assign(load=numpy.linspace(-1.0, 1e300, rows), count=numpy.arange(rows), note="x")
    for index in (pandas.RangeIndex(5, rows + 5), pandas.date_range("2026-03-01", periods=rows, freq="10ms"), numpy.arange(rows)[::-1]):
        frame = extra.set_axis(index, axis=0)
        with pytest.warns(UserWarning, match="unknown columns"):
            clean = report.calibration.compensate(frame)
        assert clean.index.equals(frame.index)
        for name in ("load", "count"):
            numpy.testing.assert_array_equal(clean[name], frame[name])
        assert list(clean["note"]) == ["x"] * rows
    # of which rows were left out, nobody can say what they are called
    gaps = table.astype(float)
    gaps.loc[10:12, "xc_v"] = numpy.nan
    with pytest.warns(UserWarning, match="3 of 1000 rows dropped"):
        assert len(report.calibration.compensate(gaps)) == rows - 3


def test_sound_data_without_an_answer_says_so_with_its_report(folder, cli):
    table = pandas.read_csv(folder / "rot+500.csv")
    # an angle that follows nothing
    rng = numpy.random.default_rng(1)
    for name in ("xc_v", "xs_v", "yc_v", "ys_v"):
        table[name] = rng.normal(size=len(table))
    with pytest.raises(cvg.NoAnswer) as raised:
        cvg.identify(table, name="standard input")
    printed = cli("identify", "-", "--json", stdin=table.to_csv(index=False).encode(), status=1)
    assert raised.value.json is not None and raised.value.json + "\n" == printed
    assert pickle.loads(pickle.dumps(raised.value)).json == raised.value.json


def test_a_file_of_the_name_of_a_frame_is_not_taken_for_it(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bench").write_text("not what was read")
    report = cvg.identify(pandas.read_csv(folder / "rot+500.csv"), name="bench")
    assert report.inputs == [{"file": "bench", "crc32": None}]


def test_what_a_mask_hides_is_missing_and_not_read(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    plain = {name: table[name].to_numpy() for name in table.columns}
    hidden = numpy.zeros(len(table), dtype=bool)
    hidden[300:340] = True
    absent, masked = dict(plain), dict(plain)
    absent["xc_v"] = numpy.where(hidden, numpy.nan, plain["xc_v"])
    # beneath the mask stands what was never measured
    masked["xc_v"] = numpy.ma.masked_array(numpy.where(hidden, 0.5, plain["xc_v"]), hidden)
    read = [cvg.identify(columns, name="bench").to_json() for columns in (absent, masked, plain)]
    assert read[0] == read[1] != read[2]


def frames(table: pandas.DataFrame):
    """The same recording in as many forms as programs keep it."""
    arrow = pyarrow.Table.from_pandas(table)

    def with_rate(rate):
        return arrow.set_column(arrow.schema.get_field_index("rate_dps"), "rate_dps", rate)

    yield "text", table.astype(str)
    yield "text of Arrow", pyarrow.table({name: table[name].astype(str) for name in table})
    yield "texts in arrays", {name: table[name].astype(str).to_numpy() for name in table}
    yield "Python's numbers", {name: table[name].astype(object).to_numpy() for name in table}
    yield "nullable numbers", table.astype("Float64").astype({"rate_dps": "Int64"})
    yield "categories", table.astype({"rate_dps": "category"})
    yield "dictionary", with_rate(arrow["rate_dps"].dictionary_encode())
    yield "decimal", with_rate(arrow["rate_dps"].cast(pyarrow.decimal128(30, 3)))
    yield "float16", with_rate(arrow["rate_dps"].cast(pyarrow.float16()))
    yield "Decimal", {name: table[name] for name in table} | {"rate_dps": [decimal.Decimal(500)] * len(table)}
    yield "chunks", pyarrow.concat_tables([arrow.slice(at, 97) for at in range(0, len(arrow), 97)])
    yield "big-endian", {name: table[name].to_numpy().astype(">f8") for name in table}
    yield "strides", {name: numpy.repeat(table[name].to_numpy(), 3)[::3] for name in table}
    yield "backwards", {name: table[name].to_numpy()[::-1].copy()[::-1] for name in table}
    yield "series of polars", {name: polars.from_pandas(table)[name] for name in table}
    yield "an index of times", table.set_index("t_s")
    yield "views of text", pyarrow.table({name: pyarrow.array(table[name].astype(str)).cast(pyarrow.string_view()) for name in table})
    yield "records", table.to_records(index=False)
    yield "columns of a block", {name: table.to_numpy()[:, at] for at, name in enumerate(table)}
    frozen = {name: table[name].to_numpy().copy() for name in table}
    for values in frozen.values():
        values.setflags(write=False)
    yield "not to be written", frozen
    yield "a stream", arrow.to_reader()


def test_the_same_recording_in_any_form_has_the_same_report(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    expected = cvg.identify(table, name="bench").to_json()
    for form, frame in frames(table):
        assert cvg.identify(frame, name="bench").to_json() == expected, form


def test_what_is_not_there_is_missing_in_any_form(folder):
    table = pandas.read_csv(folder / "rot+500.csv").astype(float)
    table.iloc[77] = numpy.nan
    expected = cvg.identify(table, name="bench").to_json()
    numbers = polars.from_pandas(table, nan_to_null=True)
    forms = {
        "polars": numbers,
        "pandas": table.astype("Float64"),
        "lists": {name: [None if value != value else value for value in table[name]] for name in table},
        "objects of pandas": {name: table[name].astype("Float64").astype(object).to_numpy() for name in table},
        "arrays of Arrow": {name: numbers[name].to_arrow() for name in numbers.columns},
    }
    for form, frame in forms.items():
        assert cvg.identify(frame, name="bench").to_json() == expected, form


def test_time_stamps_are_counted_from_the_first(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    stamps = pandas.Timestamp("2026-03-01 12:00") + pandas.to_timedelta(table["t_s"], unit="s")
    own = table.assign(t_s=stamps)
    plain = {name: table[name].to_numpy() for name in table}
    forms = {
        "pandas": own,
        "a zone": own.assign(t_s=stamps.dt.tz_localize("Europe/Berlin")),
        "an index": own.set_index("t_s"),
        "polars": polars.from_pandas(own),
        "numpy": plain | {"t_s": stamps.to_numpy()},
        "Python": plain | {"t_s": list(stamps.dt.to_pydatetime())},
    }
    for form, frame in forms.items():
        report = cvg.identify(frame, name="bench")
        assert any("dates" in warning for warning in report.warnings), form
        expected = cvg.identify(table, name="bench")
        for one, other in zip(report.parameters, expected.parameters):
            assert one.name == other.name and one.value == pytest.approx(other.value, rel=1e-6, abs=1e-9), form
    for differences in (table.assign(t_s=stamps - stamps[0]), plain | {"t_s": (stamps - stamps[0]).to_numpy()}):
        with pytest.raises(cvg.InputError, match="`t_s` is of .*(Duration|timedelta).*wanted numbers"):
            cvg.identify(differences)


def test_a_column_that_is_no_channel_is_in_nobodys_way(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    expected = [p.value for p in cvg.identify(table).parameters]
    rows = len(table)
    for what, column in {
        "stamps": [pandas.Timestamp("2026-03-01")] * rows,
        "days": [datetime.date(2026, 3, 1)] * rows,
        "lists": [[1.0, 2.0]] * rows,
        "objects": [{"a": [1]}] * rows,
        "of two kinds": [1 if row % 2 else "a" for row in range(rows)],
        "beyond integers": [10**30] * rows,
        "bytes": [b"x"] * rows,
        "categories": pandas.Categorical(["a", "b"] * (rows // 2)),
    }.items():
        report = cvg.identify(table.assign(extra=column))
        assert [p.value for p in report.parameters] == expected, what
        assert any("extra" in warning for warning in report.warnings), what


def test_what_is_no_table_says_what_is_wanted(folder):
    table = pandas.read_csv(folder / "rot+500.csv")
    with pytest.raises(cvg.InputError, match="one column of a name"):
        cvg.identify(pandas.concat([table, table[["xc_v"]]], axis=1))
    for wrong in (polars.from_pandas(table).lazy(), (row for row in ()), table.to_numpy()):
        with pytest.raises(TypeError, match="wanted a frame with its rows"):
            cvg.identify(wrong)
    with pytest.raises(cvg.InputError, match="say which column is which"):
        cvg.identify(table.set_axis(pandas.MultiIndex.from_tuples([("a", name) for name in table]), axis=1))


def test_the_report_has_its_facts_as_attributes_frames_and_a_page(report):
    assert report.status == "answered" and report.device == "unit-07"
    assert report.heldout["discovered"]["rms_deg"] < report.heldout["raw"]["rms_deg"]
    with pytest.raises(AttributeError, match="no `colour`"):
        report.colour
    frame = report.to_frame()
    row = frame.set_index("name").loc["detection_gain_ratio"]
    assert row["value"] == report.detection_gain_ratio["value"]
    assert [row["low"], row["high"]] == report.detection_gain_ratio["ci95"]
    page = report._repr_html_()
    assert page.startswith("<iframe sandbox") and "unit-07" in page and re.search(r'[^=]"[^ >]', page) is None
    assert "unit-07" in str(report) and "answered" in repr(report)


def test_residuals_are_arrow_and_numpy_alike(report):
    for table in (report.residuals(), report.bias()):
        arrow, arrays = pyarrow.table(table), table.to_dict()
        assert len(table) == arrow.num_rows > 100 and arrow.column_names == table.column_names
        assert set(arrays["run"]) <= {"rot+500.csv", "rot-300.csv"}
        for name in table.column_names[1:]:
            numpy.testing.assert_array_equal(arrow[name].to_numpy(), arrays[name])
        assert polars.DataFrame(table).equals(polars.from_arrow(arrow))
    assert numpy.sqrt(numpy.mean(report.residuals().to_dict()["error_deg"] ** 2)) < 0.1


def test_the_interpreter_is_free_meanwhile_and_progress_is_told(folder):
    ticks, told, done = [], [], threading.Event()

    def tick() -> None:
        while not done.wait(0.005):
            ticks.append(time.monotonic())

    other = threading.Thread(target=tick)
    other.start()
    began = time.monotonic()
    cvg.identify(folder / "campaign.toml", progress=told.append)
    lasted = time.monotonic() - began
    done.set()
    other.join()
    assert told[:2] == ["reading", "identifying"] and told[-1] == "reporting" and "fitting the declared model" in told
    # held for the whole time, the other thread had not run at all
    assert len(ticks) > 0.1 * lasted / 0.005, (len(ticks), lasted)


def test_a_keyboard_interrupt_ends_it(folder):
    def interrupt(what: str) -> None:
        if what == "fitting the declared model":
            os.kill(os.getpid(), signal.SIGINT)

    # a shell that runs this in the background has the signal ignored, and Python then leaves it so
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            cvg.identify(folder / "campaign.toml", progress=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)
    # and what comes after is not disturbed
    assert cvg.identify(folder / "campaign.toml").status == "answered"


def test_what_progress_raises_comes_back(folder):
    def refuse(what: str) -> None:
        raise LookupError(what)

    with pytest.raises(LookupError, match="reading"):
        cvg.identify(folder / "campaign.toml", progress=refuse)


def test_a_simulation_says_what_it_was_set_to():
    with pytest.raises(cvg.InputError, match="line 2, column"):
        cvg.simulate("device = 'a'\nrun = 3\n")
    with pytest.raises(cvg.InputError) as raised:
        cvg.simulate("nowhere.toml")
    assert raised.value.file == "nowhere.toml"


def test_the_instrument_steps_over_arrays_and_goes_on_where_it_was():
    t = numpy.arange(4000) / 100_000.0
    x, y = 0.5 * numpy.cos(2e5 * numpy.pi * 0.152 * t), numpy.full_like(t, 0.0)
    whole, parts = cvg.Instrument(), cvg.Instrument()
    once = whole.step(x, y)
    twice = [parts.step(x[i : i + 1000], y[i : i + 1000]) for i in range(0, 4000, 1000)]
    for got, pieces in zip(once, zip(*twice)):
        numpy.testing.assert_array_equal(got, numpy.concatenate(pieces))
    assert whole.mode == parts.mode and whole.fault == parts.fault
    assert numpy.isfinite(once[0]).all() and numpy.abs(once[0]).max() <= 10.0
    total = cvg.Instrument().step(numpy.array([numpy.nan, numpy.inf]), numpy.array([0.0, -numpy.inf]))
    assert all(numpy.isfinite(out).all() for out in total)
    # whatever numpy makes an array of
    narrow = x[:1000].astype("f4")
    expected = cvg.Instrument().step(narrow.astype(float), y[:1000])
    for form in (narrow, list(map(float, narrow)), pandas.Series(narrow), narrow.astype(">f4"), numpy.repeat(narrow, 2)[::2]):
        for got, wanted in zip(cvg.Instrument().step(form, y[:1000]), expected):
            numpy.testing.assert_array_equal(got, wanted)
    with pytest.raises(TypeError):
        cvg.Instrument().step(numpy.zeros((2, 2)), numpy.zeros((2, 2)))
    with pytest.raises(cvg.InputError):
        cvg.Instrument(sample_hz=-1.0)
    with pytest.raises(cvg.InputError, match="as many"):
        whole.step(x, y[1:])


def test_a_calibration_travels_between_processes(report):
    assert pickle.loads(pickle.dumps(report.calibration)).to_text() == report.calibration.to_text()


def travelled(what, how):
    return {"pickle": lambda: pickle.loads(pickle.dumps(what)), "copy": lambda: copy.copy(what), "deep": lambda: copy.deepcopy(what)}[how]()


@pytest.mark.parametrize("how", ["pickle", "copy", "deep"])
def test_a_report_says_all_it_says_behind_a_pickle_and_as_a_copy(folder, how):
    report = cvg.identify(folder / "campaign.toml", limits={"heldout.discovered.rms_deg": {"max": 1e-9}})
    again = travelled(travelled(report, how), how)
    assert (again.to_json(), again.html(), str(again), repr(again)) == (report.to_json(), report.html(), str(report), repr(report))
    assert again.parameters == report.parameters and again.verdicts == report.verdicts and again.is_within_limits is False
    assert again.calibration.to_text() == report.calibration.to_text()
    assert again.to_frame().equals(report.to_frame())
    for one, other in ((report.residuals(), again.residuals()), (report.bias(), again.bias())):
        assert pyarrow.table(one).schema == pyarrow.table(other).schema and len(other) > 0
        for name, values in one.to_dict().items():
            numpy.testing.assert_array_equal(values, other.to_dict()[name])
    # what is changed in the one is not changed in the other
    again.heldout["raw"] = None
    assert report.heldout["raw"] is not None


@pytest.mark.parametrize("how", ["pickle", "copy", "deep"])
def test_a_simulation_and_its_tables_travel(folder, how):
    simulation = cvg.simulate(SCENARIO)
    again = travelled(simulation, how)
    assert (again.campaign_toml, again.truth_toml) == (simulation.campaign_toml, simulation.truth_toml)
    for (name, table), (other, moved) in zip(simulation.recordings, again.recordings):
        assert name == other and pyarrow.table(travelled(table, how)).equals(pyarrow.table(moved))


def test_a_copy_of_an_instrument_goes_on_by_itself():
    whole = cvg.Instrument()
    x = 0.5 * numpy.cos(numpy.arange(2000))
    whole.step(x, x)
    for again in (copy.copy(whole), copy.deepcopy(whole)):
        first = again.step(x, x)
        again = copy.copy(whole)
        for got, expected in zip(again.step(x, x), first):
            numpy.testing.assert_array_equal(got, expected)


def test_threads_are_counted_at_the_first_answer_and_not_at_the_import(folder):
    # a worker of Dask imports what its client did before it hears how many threads it may have
    said = """
import os, sys
import cvg
os.environ["RAYON_NUM_THREADS"] = sys.argv[2]
cvg.identify(sys.argv[1])
print(len(os.listdir("/proc/self/task")))
"""
    campaign = str(folder / "campaign.toml")
    environment = {name: value for name, value in os.environ.items() if name != "RAYON_NUM_THREADS"}
    threads = [
        int(subprocess.run([sys.executable, "-c", said, campaign, number], env=environment, capture_output=True, check=True).stdout)
        for number in ("1", "2")
    ]
    processors = len(os.sched_getaffinity(0))
    assert threads[1] - threads[0] == min(2, processors) - 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_process_that_comes_of_one_that_has_answered_answers_as_well(folder, method):
    # a forked process has the memory of the threads that answered before, and none of the threads
    said = """
import multiprocessing, sys
import cvg

def answer(campaign):
    return cvg.identify(campaign).to_json()

if __name__ == "__main__":
    before = answer(sys.argv[1])
    with multiprocessing.get_context(sys.argv[2]).Pool(2) as pool:
        assert pool.map_async(answer, [sys.argv[1]] * 4).get(timeout=60) == [before] * 4
"""
    script = folder.parent / f"{method}.py"
    script.write_text(said)
    done = subprocess.run([sys.executable, "-W", "ignore", script, folder / "campaign.toml", method], timeout=100, check=False)
    assert done.returncode == 0
