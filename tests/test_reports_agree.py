"""One report says one thing once: poses and moves keep their numbers, parameters their units, residuals their names."""

import re
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from trihedron.records import FindingCode
from trihedron.records.domains import DOMAINS
from trihedron.report import to_text
from trihedron.report.axes import axes_of
from trihedron.report.calibration import axes_table, calibration_report
from trihedron.report.calibration_pictures import uncalibrated_error
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.verification import verification_report
from trihedron.simulate import hand_session, scenario_by_name, simulate
from written_session import G, simulated, usual

GRAVITY = float(G)


def test_moves_of_a_verification_are_counted_from_one_as_in_its_figure():
    recording, result, _ = usual()
    checked = trihedron.verify(result, recording, gravity_m_s2=GRAVITY)
    document = verification_report(checked.verification, checked.segments)
    moves = next(s for s in document.sections if s.heading == "Poses and moves").blocks[1]
    assert [row[0] for row in moves.rows] == [str(k + 1) for k in checked.verification.moves]


def test_a_domain_agrees_exactly_up_to_the_limit_of_its_figure_and_is_never_named_by_its_id():
    _, _, found = usual()
    judged = [one for one in found.domains if one.limit is not None]
    assert {one.domain for one in judged} >= {"static-accel", "moves", "dynamics"}
    assert not re.search("|".join(name for name in DOMAINS if "-" in name), to_text(diagnosis_report(found)))
    assert all(one.disagrees == (one.chi2_per_dof > one.limit) for one in judged)


def test_a_bias_has_one_sign_and_one_value_in_every_report():
    recording, result, _ = usual()
    text = trihedron.report(result)
    expected = -np.linalg.solve(result.accelerometer.S, result.accelerometer.b)
    expected /= np.linalg.norm(np.linalg.inv(result.accelerometer.S), axis=1)
    # The error before the calibration stands beside the one after it as the figure has it.
    error = uncalibrated_error(result.calibration, result.segments.accelerometer_mean)
    before = re.search(r"^ *before calibration +(\S+) mm/s²", text, re.MULTILINE)
    assert float(before[1]) == pytest.approx(1e3 * np.sqrt(np.mean(error**2)), rel=5e-3)
    line = re.search(r"^bias +X (\S+) ± (\S+?), Y", text, re.MULTILINE)
    # The figure is printed to two digits of its uncertainty, in mm/s².
    assert abs(float(line[1].replace("−", "-")) - 1000.0 * expected[0]) < float(line[2])
    other = simulated(hand_session(n_poses=14, pose_s=2.0, move_s=1.0), seed=4)
    several = trihedron.calibrate_sessions([recording, other], gravity_m_s2=GRAVITY)
    common = next(
        one for one in several.model.repeated if (one.parameter.id, one.parameter.name) == ("accel-bias", "x")
    )
    # Two sessions of one simulated unit: their common bias is that of the first within both uncertainties.
    assert abs(common.value - expected[0]) < 5.0 * common.std
    again = trihedron.diagnose(recording, calibration=result)
    given = next(one for one in again.parameters if (one.id, one.name) == ("accel-bias", "x"))
    assert given.model == pytest.approx(expected[0], abs=1e-9)
    for one in (result, several, again):
        assert "the reading without input (sign opposite to b)" in re.sub(r"\s+", " ", trihedron.report(one))


def test_the_uncertainty_of_a_scale_is_one_figure_wherever_it_is_stated():
    _, result, _ = usual()
    document = calibration_report(result.calibration)
    axes = next(s for s in document.sections if s.heading == "Axes").blocks
    for sensor, table in zip(("accelerometer", "gyroscope"), axes, strict=True):
        worst = max((row[2] for row in table.rows), key=float)
        headline = next(h for h in document.headlines if h.what == f"{sensor} scale uncertainty")
        assert (table.head[2], headline.unit, headline.value) == ("relative σ [%]", "%", worst)
        # A bias stands once, in SI, over the sensitivity; the raw reading without input has another name.
        assert table.head[-1].startswith("reading without input, −S⁻¹ b [count")
    one = replace(result.accelerometer, S=np.eye(3), raw_unit="m/s^2")
    assert "without input" not in " ".join(axes_table("accelerometer", one, axes_of(one)).head)


@pytest.mark.parametrize("shift_deg_s", [0.0, 0.1])
def test_verify_and_diagnose_judge_the_bias_of_another_session_alike(shift_deg_s):
    # The bias of this unit changes by 6 σ of both calibrations between these sessions: 1/f noise, and no fault.
    motions = (hand_session(n_poses=n, pose_s=3.0, move_s=2.5, first_pose_s=5.0) for n in (24, 18))
    scenarios = (replace(scenario_by_name("hand-session"), motion=motion) for motion in motions)
    first, second = (simulate(scenario, seed)[0] for scenario, seed in zip(scenarios, (3, 9), strict=True))
    own = trihedron.calibrate(first, gravity_m_s2=9.80665).calibration
    known = replace(own, gyroscope=replace(own.gyroscope, b=own.gyroscope.b + np.radians(shift_deg_s)))
    shifts = [one for one in trihedron.verify(known, second).findings if one.code is FindingCode.CALIBRATION_SHIFT]
    against = trihedron.diagnose(second, calibration=known)
    assert bool(shifts) == any(one.significant for one in against.parameters if one.id == "gyro-bias")
    assert bool(shifts) == (shift_deg_s > 0.0)
    assert all("°/s" in one.seen for one in shifts)
