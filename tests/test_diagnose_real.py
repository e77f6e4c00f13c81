"""What the diagnosis says of real recordings, causes withheld (docs/diagnosis-real.md)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from trihedron import calibrate, diagnose
from trihedron.read import read_recording
from trihedron.records.published import published_figures
from trihedron.session.aliasing import unresolved_variance

SENSORS = (("accelerometer", "acc"), ("gyroscope", "gyro"))


def diagnosed(gravity: float, first: float = 0.0, last: float = 1.0, **arguments: object):
    """The diagnosis of a log, or of a part of its rows."""
    recording = read_recording(**arguments)
    rows = slice(int(first * recording.n_samples), int(last * recording.n_samples))
    readings = {name: getattr(recording, name) for name in ("accelerometer", "gyroscope", "temperature_degc")}
    readings = {name: column[rows] for name, column in readings.items() if column is not None}
    recording = replace(recording, time_s=recording.time_s[rows] - recording.time_s[rows.start], **readings)
    return diagnose(recording, gravity_m_s2=gravity)


@pytest.fixture(scope="module")
def xsens(real_data: Path):
    """Its calibration, and its diagnosis from the same segments."""
    recording = read_recording(**{f"{s}_path": real_data / f"xsens_mti/xsens_{stem}.txt" for s, stem in SENSORS})
    result = calibrate(recording, gravity_m_s2=9.81744)
    return result, diagnose(recording, segments=result.segments, gravity_m_s2=9.81744)


def test_xsens_holds_g_sensitivity_and_gravity_after_moves_gains(xsens) -> None:
    _, d = xsens
    assert d.verdict == "missing-physics"
    first = d.effects[0]
    assert first.id == "gyro-g-sensitivity"
    matrix = {p.name: p.value for p in first.parameters}
    assert abs(matrix["G_yx"]) * 9.80665 == pytest.approx(np.radians(0.16), rel=0.1)  # deg/s per g
    moves = next(h for h in first.held_out if h.domain == "moves")
    # Before, biases of any scatter take up a part of it, 0.44° with none. χ², which noise enters, falls sixfold.
    assert moves.rms_before > 2.3 * moves.rms_after
    assert moves.rms_after < 0.14
    assert moves.chi2_per_dof_before > 5.0 * moves.chi2_per_dof_after


def test_a_session_with_wild_rotation_at_its_end_is_healthy_but_for_the_range(real_data: Path) -> None:
    d = diagnosed(9.8184, first=0.4, path=real_data / "mimu4444/exp_2.npz", instance=1)
    assert [e.id for e in d.effects] == ["gyro-saturation"]
    agree = {t.domain: t.chi2_per_dof for t in d.remaining if not t.disagrees}
    assert {"static-accel", "static-gyro", "moves", "dynamics"} <= set(agree)


def test_a_rate_that_steps_between_samples_is_charged_with_what_its_integral_misses() -> None:
    rng = np.random.default_rng(5)
    step, n, moves = 0.01, 200, 300
    jumps = rng.normal(size=(moves, 3))
    at = (100.0 + rng.random(moves)) * step  # where between two samples
    t = np.arange(n) * step
    rate = np.where(t[None, :, None] >= at[:, None, None], jumps[:, None, :], 0.0).reshape(-1, 3)
    # Sum of the samples less the true integral, both up to the last sample.
    missed = rate.reshape(moves, n, 3).sum(axis=1) * step - jumps * (n * step - at)[:, None]
    missed += 0.5 * jumps * step  # the first sample after the jump comes half a step late in the mean
    ranges = tuple((k * n + 50, k * n + 150) for k in range(moves))
    poses = [(k * n + 5, k * n + 45) for k in range(moves)]
    charged = unresolved_variance(rate, ranges, poses, step, np.zeros(3))
    # 900 squares of a jump times a phase have a mean certain to 7 %: two of those, and a tenth for the width of the
    # band, over which a step's power is above that at its middle.
    assert np.mean(missed**2) == pytest.approx(np.mean(charged), rel=0.25)


def test_moves_left_out_at_a_limit_explain_only_what_they_disagree_by_more_than_others(real_data: Path) -> None:
    d = diagnosed(9.8127, path=real_data / "openaxes/adxl355.csv")
    assert d.effects[0].id == "accel-cubic"
    limit = next(e for e in d.effects if e.id == "accel-saturation")
    assert limit.share < d.effects[0].share


def test_an_answer_that_poses_support_stands_though_moves_are_spoilt(real_data: Path) -> None:
    # Pooled with moves that lost samples or hold an unknown arm, it was thrown out again.
    paths = {f"{sensor}_path": real_data / f"getovermassif/session2_{stem}.txt" for sensor, stem in SENSORS}
    d = diagnosed(9.803, last=0.5, **paths)
    assert d.effects[0].id == "gyro-g-sensitivity"
    held = next(h for h in d.effects[0].held_out if h.domain == "static-gyro")
    assert held.chi2_per_dof_before > 1.8 * held.chi2_per_dof_after
    assert held.chi2_per_dof_after < 1.5


def test_calibrate_diagnose_and_the_readme_give_one_figure_each_for_xsens(xsens) -> None:
    result, d = xsens
    figures = published_figures(result.calibration)
    quality = result.calibration.accelerometer.quality
    readme = (Path(__file__).parents[1] / "README.md").read_text()
    row = next(line for line in readme.splitlines() if line.startswith("| Xsens MTi"))
    assert f"| {1e3 * quality.held_out_rms:.2f} mm/s² cross-validated (noise alone {1e3 * quality.floor:.2f})" in row
    assert f"tilt {figures['tilt_error_after_rotations']['held_out_rms']:.3f}° after unseen rotations" in row
    assert d.to_dict()["figures"] == figures
