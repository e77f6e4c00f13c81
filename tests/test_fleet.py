"""Many logs of many devices: one table, nothing done twice, nothing lost, one bad log stops nobody."""

import json
import os
import signal

import numpy as np
import polars
import pytest

import trihedron
from hand_made_sessions import G, Instrument, recorded
from trihedron.api import calibrating
from trihedron.fleet import find_jobs, running, summarise
from trihedron.fleet.summary import _spread_of_axes
from trihedron.fleet.work import work
from trihedron.records.sessions import PARAMETERS
from trihedron.report.fleet import fleet_report


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two devices of two sessions, the second device's gyro bias 0.02 rad/s away in its second, and what is no log."""
    folder = tmp_path_factory.mktemp("fleet")
    for unit in range(2):
        for session in range(2):
            moved = 0.02 if (unit, session) == (1, 1) else 0.0
            instrument = Instrument().moved(b_g=[0.005 * unit + moved, 0.0, 0.0])
            path = folder / f"unit_{unit}" / f"log_{session}.csv"
            path.parent.mkdir(exist_ok=True)
            trihedron.convert(recorded(instrument, 10 * unit + session, n_poses=14), path)
    (folder / "unit_0" / "notes.txt").write_text("the sensor was warm\n")
    return folder


@pytest.fixture(scope="module")
def done(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return trihedron.fleet(logs, out, workers=0, diagnose=False, gravity_m_s2=G), out


def test_every_log_has_its_row_and_file_the_bad_one_its_reason_and_the_device_that_changed_its_name(done):
    result, out = done
    table = polars.read_parquet(out / "fleet.parquet")
    assert table.height == 5
    assert result.n_done == 4
    bad = table.filter(polars.col("status") == "rejected")
    assert bad["path"].item().endswith("notes.txt")
    assert len(bad["reason"].item()) > 20
    assert polars.read_csv(out / "fleet.csv").height == 5
    zero = table.filter(polars.col("status") == "done")["gyro_bias_x_rad_s"]
    # Zeros along the axis: -(M b) with scales within 2 % of one.
    np.testing.assert_allclose(sorted(-zero), sorted([0.01, 0.01, 0.015, 0.035]), rtol=0.05, atol=1e-3)
    # The calibration of every log is a file that goes into another program's.
    files = sorted((out / "calibrations").iterdir())
    assert [file.name[:12] for file in files] == [f"unit_{u}_log_{s}" for u in range(2) for s in range(2)]
    assert trihedron.read_calibration(files[0]).accelerometer.quality is not None
    moved = [(c.group, c.id) for c in result.summary.changes if c.significant]
    assert moved == [("unit_1", "gyro-bias")]
    page = (out / "fleet.html").read_text()
    assert all(said in page for said in ("unit_1", "notes.txt", "<svg"))


def test_logs_that_are_done_are_not_done_again(logs, done, monkeypatch):
    _, out = done

    def never(*_):
        raise AssertionError("a log was done twice")

    monkeypatch.setattr(running, "work", never)
    again = trihedron.fleet(logs, out, workers=0, diagnose=False, gravity_m_s2=G)
    assert again.summary.n_before == 5
    assert again.n_done == 4


def test_other_bytes_options_or_devices_make_another_key_and_devices_are_named_by_folder_or_expression(logs, tmp_path):
    jobs = find_jobs(logs, {"gravity_m_s2": G})
    keys = {job.key for job in jobs}
    assert len(keys) == 5
    assert not keys & {job.key for job in find_jobs(logs, {"gravity_m_s2": 9.8})}
    path = logs / "unit_0" / "log_0.csv"
    changed = tmp_path / "log_0.csv"
    changed.write_bytes(path.read_bytes() + b"\n")
    assert find_jobs(changed, {})[0].key != find_jobs(path, {})[0].key
    assert {job.serial for job in jobs} == {"unit_0", "unit_1"}
    assert {job.serial for job in find_jobs(logs, {}, serial=r"unit_(\d)")} == {"0", "1"}
    with pytest.raises(ValueError, match="one group"):
        find_jobs(logs, {}, serial="unit")
    with pytest.raises(ValueError, match="no such file"):
        find_jobs(logs / "nowhere", {})


def test_a_defect_of_the_program_is_a_row_and_is_tried_again(logs, tmp_path, monkeypatch):
    def defect(*_args, **_options):
        raise ZeroDivisionError("by nothing")

    path = logs / "unit_0" / "log_0.csv"
    # Whole, with its diagnosis; whoever imports `calibrate` has then done so.
    assert work(str(path), None, {"gravity_m_s2": G})["diagnosis"]["verdict"] == "consistent"
    with monkeypatch.context() as patch:
        patch.setattr(calibrating, "calibrate", defect)
        first = trihedron.fleet(path, tmp_path, workers=0, diagnose=False, gravity_m_s2=G)
    assert first.rows[0]["status"] == "crashed"
    assert "ZeroDivisionError" in first.rows[0]["reason"]
    assert trihedron.fleet(path, tmp_path, workers=0, diagnose=False, gravity_m_s2=G).n_done == 1


def row(serial, name, numbers, sigma=1e-4):
    """A calibrated log's row as a worker writes it."""
    return {
        **{"path": "", "name": name, "serial": serial, "status": "done", "is_trustworthy": True},
        **{"accelerometer_unit": "m/s^2", "gyroscope_unit": "rad/s", "parameters": numbers.tolist()},
        **{"covariance": (np.eye(21) * sigma**2).tolist(), "bias_drift_variance": [0.0] * 21},
    }


def test_one_of_six_devices_far_off_is_seen_and_sound_fleets_have_none(tmp_path):
    rng = np.random.default_rng(8)
    found, alarms = 0, 0
    # Kinds of numbers with sizes of their own, axes of one kind made alike.
    sizes = np.repeat([0.3, 0.01, 0.01, 0.02, 0.01, 0.01, 0.01], 3)
    for _ in range(15):
        numbers = rng.normal(size=(6, 21)) * sizes
        rows = [row(f"u{k}", str(k), one) for k, one in enumerate(numbers)]
        sound = summarise(rows, tmp_path).summary
        alarms += bool(sound.outliers)
        assert sound.farthest.p_adjusted >= 0.01
        k, j = rng.integers(6), rng.integers(21)
        numbers[k, j] += 8.0 * sizes[j]
        strays = summarise([row(f"u{k}", str(k), one) for k, one in enumerate(numbers)], tmp_path).summary.outliers
        found += (f"u{k}", j) in [(one.serial, PARAMETERS.index(one.parameter)) for one in strays]
    # One in a hundred sound fleets: three of 15 come once in 2000. Of the strays two in three: by each axis alone, one
    # in fifteen.
    assert alarms <= 2
    assert found >= 7
    assert sound.outliers or sound.farthest.serial in fleet_report(sound).verdict
    few = summarise([row(f"u{k}", str(k), one) for k, one in enumerate(numbers[:3])], tmp_path).summary
    assert (few.farthest, "No device stands out" in fleet_report(few).verdict) == (None, False)


def test_the_spread_that_is_expected_of_an_axis_is_that_of_its_triad():
    rng = np.random.default_rng(3)
    sizes = np.exp(rng.normal(size=(100, 7))).repeat(3, axis=1)
    ratio = [_spread_of_axes(rng.normal(size=(6, 21)) * sd)[0] / sd**2 for sd in sizes]
    # Two other axes of six devices know a variance to a half: 2100 of them, related by threes, their mean to 2 %.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.12)


def test_logs_of_two_units_in_one_folder_are_not_one_device(tmp_path):
    rng = np.random.default_rng(4)
    sigma = 1e-4
    one, other = rng.normal(size=(2, 21)) * 1e-2
    other[12] = one[12] - 0.6  # a gyro of another range: -46 %
    repeats = rng.normal(size=(4, 21)) * sigma
    rows = [row("logs", str(k), (one, other)[k % 2] + repeats[k], sigma) for k in range(4)]
    rows += [row("another", str(k), one + repeats[k], sigma) for k in range(2)]
    result = summarise(rows, tmp_path)
    (mixed,) = result.summary.mixed
    assert (mixed.serial, mixed.n_logs, mixed.parameter.id) == ("logs", 4, "gyro-scale")
    assert fleet_report(result.summary).level == "bad"
    assert summarise(rows[4:], tmp_path).summary.mixed == ()


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_is_killed_loses_nothing(logs, tmp_path):
    pytest.importorskip("distributed")
    killed = []

    def kill_one(_fraction, _text):
        kept = [json.loads(path.read_text()) for path in (tmp_path / "results").glob("*.json")]
        pids = [row["worker"] for row in kept if row["worker"] != os.getpid()]
        if pids and not killed:
            killed.append(pids[0])
            os.kill(pids[0], signal.SIGKILL)

    two = logs / "unit_1"
    result = trihedron.fleet(two, tmp_path, workers=1, diagnose=False, gravity_m_s2=G, progress=kill_one)
    assert len(killed) == 1
    assert [row["status"] for row in result.rows] == ["done"] * 2
