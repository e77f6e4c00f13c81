"""A log held against known motion: what the reference says, how sure it is, and what it rejects."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from reference_rig import G, commanded_table, forces, hand, measured_table, rates_of, times, tracked, unit
from trihedron._core import rotation_from_vector
from trihedron.api.beside import shared_log
from trihedron.estimate.filter_noise.beside_reference import Request, beside_reference
from trihedron.estimate.reference.accelerometer import fit_accelerometer
from trihedron.estimate.reference.clocks import Alignment
from trihedron.estimate.reference.fit import fit_reference
from trihedron.estimate.reference.together import Reference, grid_of, windows_beside
from trihedron.files.calibration import diagnosis_document
from trihedron.records import Severity
from trihedron.records.reference import NAMED_FROM, ReferenceMotion
from trihedron.simulate import hand_session, scenario_by_name

EARTH_RAD_S = 7.292115e-5
NORTH_OF_48_DEG = EARTH_RAD_S * np.array([np.cos(np.radians(48.0)), 0.0, np.sin(np.radians(48.0))])


@pytest.fixture(scope="module")
def posed():
    return tracked(3, seconds=20, has_path=True)


@pytest.fixture(scope="module")
def found(posed):
    return fit_reference(posed.log, posed.motion, G)


@pytest.fixture(scope="module")
def table():
    return measured_table(81, 30)


def z_of(found, trial):
    A = np.linalg.inv(trial.unit.M)
    sigma = np.sqrt(np.diag(found.gyroscope.covariance))
    return np.r_[(found.gyroscope.S - A).ravel(), found.gyroscope.b + A @ trial.unit.c] / sigma


def test_gyro_clock_and_lever_arm_come_out_within_their_error_bars(posed, found):
    # One fixed trial: 4.5 sigma of some 30 numbers; coverage over many is benches/reference_coverage.py.
    assert np.abs(z_of(found, posed)).max() < 4.5
    lead = posed.lead_s + 1e-6 * posed.ppm * found.clock_middle_s
    assert abs(found.clock_offset_s[0] - lead) < 4.5 * found.clock_offset_s[1]
    assert found.clock_offset_s[1] < 2e-3  # 100 Hz on both sides: a tenth of a sample is there to be had
    assert np.all(np.abs(found.lever_arm.value - posed.arm) < 4.5 * found.lever_arm.std)
    assert np.all(found.lever_arm.std < 5e-3)
    assert np.degrees(np.arccos(found.vertical.value[2])) < 1.0


def test_a_constant_error_of_the_references_body_moves_force_and_lever_arm_by_their_response_to_it(posed):
    grid, clock = grid_of(posed.log), Alignment(posed.lead_s, 1e-6 * posed.ppm, 1.0)
    seen = grid.is_valid & Reference(posed.motion).covers(grid.time_s + clock.offset_s)
    error = 1e-4 * np.array([1.0, -2.0, 0.5])

    def fitted(attitude):
        reference = Reference(replace(posed.motion, attitude=attitude))
        windows = windows_beside(grid, reference, seen, 0.1)
        return fit_accelerometer(grid, reference, windows, clock, G, np.sign(np.linalg.det(posed.unit.M)))

    usual, turned = (fitted(posed.motion.attitude @ rotation_from_vector(one[None])) for one in (0.0 * error, error))
    expected = usual.wrt_attitude[1].sum(axis=1) @ error
    # Of second order in 1e-4 rad, with some margin for the weights, which follow the residuals.
    for part in (slice(0, 9), slice(9, 12), slice(15, 18)):
        moved = (turned.values - usual.values)[part]
        assert np.abs(moved - expected[part]).max() < 2e-3 * np.abs(expected[part]).max()


def fine_unit(seed, earth=None):
    """A gyro that shows the Earth's rate before a tracker of a hundredth of a degree."""
    return tracked(seed, 40, 0.005, earth=earth, is_fine=True, gyro_noise=5e-4)


def test_the_references_error_over_time_is_the_one_that_was_put_in():
    trial = fine_unit(3)
    time = trial.motion.time_s
    # The tracker's world rocks by half a degree about X and Y, and not about Z.
    rocks = np.radians(0.5) * np.stack(
        [np.sin(2 * np.pi * time / 20.0), np.cos(2 * np.pi * time / 15.0), 0.0 * time], 1
    )
    motion = replace(trial.motion, attitude=rotation_from_vector(rocks) @ trial.motion.attitude)
    found = fit_reference(trial.log, motion, G)
    # A reference that another gyro carried turns with the Earth.
    assert found.earth_rate is None
    seen = np.isfinite(found.apart.angle[:, 0])
    at = found.apart.time_s[seen] + trial.lead_s
    truth = np.stack([np.interp(at, time, rocks[:, k]) for k in range(3)], axis=1)
    left = found.apart.angle[seen] - (truth - truth.mean(axis=0))
    # 0.35 deg rms were put in about X and Y; a part looks like the gyro's own numbers, some tenths of it.
    assert np.degrees(left.std(axis=0)).max() < 0.12
    assert np.degrees(found.apart.angle[seen, 2].std()) < 0.03  # nothing was put in about Z
    assert np.degrees(found.apart.angle[seen, :2].std(axis=0)).min() > 0.25


def test_the_earths_rate_is_told_with_its_direction_and_is_neither_a_zero_nor_a_g_sensitivity():
    trial = fine_unit(0, NORTH_OF_48_DEG)
    found = fit_reference(trial.log, trial.motion, G)
    assert found.earth_rate is not None
    seen, sigma = found.earth_rate.value, found.earth_rate.std
    assert np.linalg.norm(seen) == pytest.approx(EARTH_RAD_S, rel=0.02)
    assert np.all(np.abs(seen - NORTH_OF_48_DEG) < 4.5 * sigma + 0.02 * EARTH_RAD_S)
    assert max(e.score for e in found.effects.values()) < NAMED_FROM
    # Three zeros a unit; before the Earth was a part of the model they stood 4.5 uncertainties off (rms of 24).
    assert np.sqrt(np.mean(np.square(z_of(found, trial)[9:]))) < 2.0
    assert abs(np.degrees(np.arcsin(seen[2] / EARTH_RAD_S)) - 48.0) < 10.0


def test_error_bars_of_a_wobbling_table_cover_the_truth():
    trials = [measured_table(500 + k, 30) for k in range(2)]
    z = np.array([z_of(fit_reference(t.log, t.motion, G), t) for t in trials])
    # Twelve numbers a table, as of few independent ones: 68 % within one sigma, less four standard errors.
    assert np.mean(np.abs(z) < 1.0) > 0.4
    assert np.mean(np.abs(z) < 2.0) > 0.8


def test_commands_of_a_rate_table_are_enough():
    trial = commanded_table(11, pose_s=3.0)
    result = trihedron.calibrate(trial.log, reference=trial.motion, gravity_m_s2=G)
    A = np.linalg.inv(trial.unit.M)
    # Plateaus of 2.5 s of a 0.05 °/s wobble and 1.5 °/s of noise a sample: 0.2 % of scale is ten times what noise does.
    assert np.allclose(np.diag(result.gyroscope.S), np.diag(A), rtol=2e-3)
    assert any(f.code == "accelerometer-nominal" for f in result.findings)
    # Each axis turns in some of the parts that are held out, and in some that are not: 12 parameters of 500 rates.
    left = result.reference.gyroscope
    assert left.rms < left.rms_held_out < 1.2 * left.rms


def test_a_log_of_a_gyro_alone_is_diagnosed_and_its_calibration_refused_in_one_sentence(table):
    result = trihedron.diagnose(table.log, reference=table.motion, gravity_m_s2=G)
    assert result.verdict == "consistent"
    # What is judged is a rate: no velocity in °/s.
    assert [(d.domain, d.unit) for d in result.domains] == [("rate", "rad/s")]
    assert diagnosis_document(result)["reference"]["accelerometer"] is None
    with pytest.raises(ValueError, match="has none"):
        trihedron.calibrate(table.log, reference=table.motion, gravity_m_s2=G)


def test_a_log_without_poses_is_calibrated_by_its_reference_and_a_rates_own_clock_stretches_no_scale(table):
    n = len(table.log.time_s)
    level = np.tile([0.0, 0.0, G], (n, 1)) + 0.01 * np.sin(np.arange(3.0 * n)).reshape(-1, 3)
    log = trihedron.Recording.from_arrays(table.log.time_s, level, table.log.gyroscope, gyroscope_unit="counts")
    result = trihedron.calibrate(log, reference=table.motion, gravity_m_s2=G)
    fast = replace(table.motion, time_s=table.motion.time_s * (1.0 + 3e-4))
    usual, stretched = result.reference, fit_reference(table.log, fast, G)
    assert stretched.clock_rate_ppm[0] - usual.clock_rate_ppm[0] == pytest.approx(300.0, abs=30.0)
    # Multiplied by the clock's ratio the scales would be off by 3e-4.
    scale = np.linalg.norm(stretched.gyroscope.S, axis=0) / np.linalg.norm(usual.gyroscope.S, axis=0)
    assert np.allclose(scale, 1.0, atol=1e-4)


def test_g_sensitivity_and_cubic_scale_are_told_from_the_linear_numbers():
    G_true = np.array([[3e-3, 0, 0], [0, -2e-3, 1e-3], [0, 0, 2e-3]])
    trial = tracked(21, seconds=15, g_sensitivity=G_true)
    result = trihedron.diagnose(trial.log, reference=trial.motion, gravity_m_s2=G)
    assert [e.id for e in result.effects] == ["gyro-g-sensitivity"]
    one = result.reference.effects["gyro-g-sensitivity"]
    assert np.abs((one.value - G_true.ravel()) / one.std).max() < 5.0
    assert result.verdict == "missing-physics"
    assert diagnosis_document(result)["reference"]["effects"]["gyro-g-sensitivity"]["score"] > 20.0


def neighbour(seed, seconds):
    """Another unit, in SI, at the origin of the body of this seed's tracked one, on a clock of its own."""
    rng = np.random.default_rng(seed)
    unit(rng)
    _, C, path = hand(rng, seconds)
    w, f = rates_of(C), forces(C, path)
    n = len(w) // 8
    return trihedron.Recording.from_arrays(
        times(n, 8) + 0.0123,
        f[: n * 8].reshape(n, 8, 3).mean(1) + 0.01 * rng.normal(size=(n, 3)),
        w[: n * 8].reshape(n, 8, 3).mean(1) + 1e-3 * rng.normal(size=(n, 3)),
    )


def test_two_rigidly_joined_units_show_how_they_are_joined():
    """Rotation and lever arm between them; and without being given, each notices the other."""
    trial, other = tracked(41, seconds=20, has_path=True), neighbour(41, 20)
    found = trihedron.diagnose(trial.log, reference=other, gravity_m_s2=G).reference
    assert found.kind == "the log of another unit"
    assert np.all(np.abs(found.lever_arm.value - trial.arm) < np.maximum(4.5 * found.lever_arm.std, 1e-3))
    # Nine parameters of S whose bias, unlike the tracker's, is the other unit's too.
    assert np.linalg.norm(z_of(found, trial)[:9]) < 4.5 * 3.0
    assert shared_log(trial.log, other, G) is not None
    assert shared_log(trial.log, neighbour(42, 20), G) is None


def test_a_simulation_moved_as_the_log_was_is_a_model_first_and_a_reference_besides():
    """A bias that the other unit has as well is no turning in its poses: they are poses, and carry the comparison."""
    motion = hand_session(n_poses=9, pose_s=2.0, first_pose_s=4.0)
    log, _ = trihedron.simulate(replace(scenario_by_name("hand-session"), motion=motion), 5)
    log = replace(log, gyroscope=log.gyroscope + np.array([0.02, -0.03, 0.025]) * np.abs(log.gyroscope).std())
    known = trihedron.calibrate(log, gravity_m_s2=G)
    twin, _ = trihedron.twin(log, known)
    found = trihedron.diagnose(log, against=twin, gravity_m_s2=G)
    assert found.reference is not None
    assert {p.id for p in found.parameters} >= {"accel-scale", "gyro-bias"}


def test_attitudes_from_world_to_body_are_read_so_and_it_is_said():
    trial = tracked(3, seconds=12)
    turned = replace(trial.motion, attitude=np.swapaxes(trial.motion.attitude, 1, 2).copy())
    found = fit_reference(trial.log, turned, G)
    assert any(f.code == "reference-turned-round" for f in found.findings)
    assert np.abs(z_of(found, trial)).max() < 4.5


def test_a_reference_that_is_mirrored_or_of_another_motion_is_refused(posed):
    flip = np.diag([1.0, -1.0, 1.0])
    motion = posed.motion
    mirrored = replace(motion, attitude=flip @ motion.attitude @ flip, position=motion.position @ flip)
    with pytest.raises(ValueError, match=r"mirrored against the log.*Turn the sign of one axis"):
        fit_reference(posed.log, mirrored, G)
    with pytest.raises(ValueError, match="share no motion"):
        fit_reference(posed.log, tracked(999, seconds=20).motion, G)


def test_a_rate_in_degrees_called_radians_and_an_axis_that_never_turned_are_refused(table):
    A = np.linalg.inv(table.unit.M)
    in_si = trihedron.Recording.from_arrays(table.log.time_s, None, table.log.gyroscope @ A.T, gyroscope_unit="rad/s")
    degrees = replace(table.motion, rate=np.degrees(table.motion.rate))
    with pytest.raises(ValueError, match=r"57\.\d times as fast.*deg"):
        fit_reference(in_si, degrees, G)
    third = table.motion.time_s < 20.0
    short = ReferenceMotion(table.motion.time_s[third], rate=table.motion.rate[third], source="two.csv")
    with pytest.raises(ValueError, match="hardly turns"):
        fit_reference(table.log, short, G)


def test_a_reference_clock_that_jumps_is_refused_with_the_place():
    trial = tracked(51, seconds=50)
    late = trial.motion.time_s + np.where(trial.motion.time_s > 25.0, 0.5, 0.0)
    with pytest.raises(ValueError, match=r"clock jumps by \+0\.5\d* s between \d+ and \d+ s of the log"):
        fit_reference(trial.log, replace(trial.motion, time_s=late), G)


def test_a_clock_that_jumps_for_some_seconds_leaves_a_deviating_interval_and_the_rest_its_answer():
    trial = tracked(53, seconds=40)
    t = trial.motion.time_s
    found = fit_reference(trial.log, replace(trial.motion, time_s=t + np.where(t > 35.0, 0.5, 0.0)), G)
    (apart,) = (one for one in found.findings if one.code == "reference-apart")
    assert " from 37 to 39 s" in apart.seen
    assert np.abs(z_of(found, trial)).max() < 4.5


def test_a_reference_that_slips_on_the_body_is_told_from_a_wobble_with_its_time_and_angle():
    trial = tracked(3, 45, 0.01)
    time = trial.motion.time_s
    axis = np.array([0.6, 0.0, -0.8])

    def turned(degrees):
        return rotation_from_vector(np.radians(degrees)[:, None] * axis)

    def turned_by(degrees):
        attitude = trial.motion.attitude @ turned(degrees)
        return fit_reference(trial.log, replace(trial.motion, attitude=attitude), G).findings

    assert all(one.code != "reference-apart" for one in turned_by(np.sin(time / 4.0)))
    findings = turned_by(np.where(time > 20.0, 2.0, 0.0))
    (apart,) = (one for one in findings if one.code == "reference-apart")
    assert apart.severity is Severity.SERIOUS
    assert apart.numbers["at_s"] == pytest.approx(20.0 - trial.lead_s, abs=1.5)
    assert abs(apart.numbers["angle_rad"] - np.radians(2.0)) < 4.5 * apart.numbers["sigma_rad"]
    # N of a filter contains no slip; the reference's own error does.
    slipped = trial.motion.attitude @ turned(np.where(time > 20.0, 2.0, 0.0))
    asked = Request((1.0, 10.0), 20.0, G)
    _, noted = beside_reference(trial.log, replace(trial.motion, attitude=slipped), asked)
    (apart,) = (one for one in noted if one.code == "reference-apart")
    assert (apart.severity, "angle_rad" in apart.numbers) == (Severity.WARNING, True)


def test_a_log_that_mostly_rests_is_held_against_its_reference_and_against_no_other():
    # Four fifths are static, as a session of poses: there the tracker's noise, as a rate, is all that either shows.
    trial = tracked(4, 24, sigma_deg=0.2, rest_s=9.6)
    assert np.abs(z_of(fit_reference(trial.log, trial.motion, G), trial)).max() < 4.5
    with pytest.raises(ValueError, match="share no motion"):
        fit_reference(trial.log, tracked(54, 24, sigma_deg=0.2, rest_s=9.6).motion, G)


def test_two_recordings_of_one_unit_share_the_scale_and_have_biases_of_their_own(posed, found):
    # The unit of this seed again, for nine seconds: by itself it shows less than the first.
    more = tracked(3, seconds=9)
    both = [posed.log, more.log], [posed.motion, more.motion]
    result = trihedron.calibrate_references(*both, gravity_m_s2=G, frame="case")
    one, other = result.references
    assert np.array_equal(one.gyroscope.S, other.gyroscope.S)
    assert not np.array_equal(one.gyroscope.b, other.gyroscope.b)
    alone = np.array(found.gyroscope.sigmas()["sigma_S"])
    assert np.all(np.array(one.gyroscope.sigmas()["sigma_S"]) < 1.05 * alone)
    assert np.abs(z_of(one, posed)).max() < 4.5


def test_an_attitude_that_the_gyro_itself_carried_is_not_independent(found):
    other = neighbour(44, 18)
    C, now = np.empty((len(other.time_s), 3, 3)), np.eye(3)
    for k, step in enumerate(rotation_from_vector(other.gyroscope[:-1] * np.diff(other.time_s)[:, None])):
        C[k] = now
        now = now @ step
    C[-1] = now
    carried = fit_reference(other, ReferenceMotion(other.time_s - other.time_s[0], attitude=C), G)
    assert "mounted-without-error" in {sign.kind for sign in carried.error.signs}
    assert any(f.code == "reference-not-independent" for f in carried.findings)
    assert not found.error.signs
