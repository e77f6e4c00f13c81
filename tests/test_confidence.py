"""Sessions of an independent generator (benches/confidence): within their bars, or marked, whatever the motion."""

import numpy as np
import pytest
from scipy.signal import lfilter

import trihedron
import trihedron.estimate.session.solved as solved_session
from confidence.motion import G, Step, attitude, move
from confidence.sensor import lower, read_out, recorded
from confidence.sessions import directions, hand, leaning, table
from trihedron import calibrate, diagnose
from trihedron.estimate.session.fit import DYNAMICS, MOVES, NO_WEIGHT

RATE_HZ, POSE_S, MOVE_S, N_POSES = 100.0, 5.0, 1.5, 18
NOISE = 0.02


def gyro_z(result, truth):
    """Errors of the gyro's scale in standard errors, and the largest in parts of the scale."""
    error = result.gyroscope.S - truth.S_w
    return error / result.gyroscope.sigma_S, np.abs(error).max() / np.abs(np.diag(truth.S_w)).mean()


def test_slow_turns_of_a_table_that_leans_are_no_part_of_the_holds():
    f, w, rate, truth, motion = table(5, turns=(180.0,), rate_deg_s=10.0, pose_s=5.0)
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G)
    assert result.segments.n_poses == len(motion.rests)
    error = np.degrees(result.gyroscope.b - lower(truth).b_w)
    # The zero of a 16-bit gyro with 20°/h of noise: hundredths of a degree per second; turns in poses gave 0.1 to 8.
    assert np.abs(error).max() < 0.02


def test_stated_turns_on_faces_win_over_a_wrong_nominal_scale_and_unstated_ones_are_read_by_gravity():
    f, w, rate, truth, motion = table(7, turns=(180.0, -180.0))
    stated = [angle for _, _, angle in motion.turns]
    wrong = {"turns_deg": stated, "gyroscope_nominal": 2.0 * truth.S_w[0, 0]}
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces", **wrong)
    z, relative = gyro_z(result, truth)
    assert np.abs(z).max() < 4.0
    assert relative < 1e-3
    # Unstated ones are read by gravity, not by a common divisor: rightly, or not at all and said so.
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces")
    if result.gyroscope is None:
        assert "turn-angle-unknown" in {finding.code for finding in result.findings}
        assert not result.is_trustworthy
    else:
        assert np.abs(result.gyroscope.S - truth.S_w).max() < 1e-3 * truth.S_w[0, 0]


def manual(seed):
    """The session of the manual's section 4: 18 poses by hand, then ±8π on three faces that are not parallel."""
    rng = np.random.default_rng([13, seed])
    tilt, lean = leaning(0.5)
    targets = [attitude(d, rng.uniform(0, 2 * np.pi)) for d in directions(18, rng)]
    steps = [Step(4.0)]
    for target in targets[1:]:
        steps += [Step(2.0, to=target), Step(4.0)]
    for up in ((0.05, 0.02, 1.0), (1.0, -0.03, 0.04), (0.02, 1.0, 0.06)):
        steps += [Step(2.5, to=lean @ attitude(up, rng.uniform(0, 2 * np.pi))), Step(4.0)]
        for angle in (1440.0, -1440.0):
            steps += [Step(abs(angle) / 120.0 / 0.92, turn=angle), Step(4.0)]
    motion, per = move(steps, targets[0], rng, 50.0, tilt=tilt, tremor=np.radians(2.0))
    return (*read_out(motion, per, rng, gyro_range=np.radians(300.0)), motion)


def test_the_manuals_session_by_stated_turns_about_any_axis_lies_inside_its_bars():
    f, w, rate, truth, motion = manual(3)
    stated = [angle for _, _, angle in motion.turns]
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=stated)
    z, relative = gyro_z(result, lower(truth))
    assert np.abs(z).max() < 4.0
    # Turns and moves together: what turns about fewer axes do not show, moves do.
    assert relative < 3e-4
    # The moves between poses tell which of two turns about one axis was stated wrongly.
    wrong = calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=[stated[0], stated[1] + 5.0, *stated[2:]])
    assert [one.numbers["turn"] for one in wrong.findings if one.code == "turn-not-a-multiple"] == [2]
    assert np.abs(gyro_z(wrong, lower(truth))[0]).max() < 4.0
    with pytest.raises(ValueError, match="5 turns were stated and 6 were found"):
        calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=stated[:5])
    # The moves between poses show the sense of the turns.
    turned = calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=[-angle for angle in stated])
    said = [one for one in turned.findings if one.code == "left-handed" and one.severity.value == "serious"]
    assert any("contradict the sense of the turns" in one.seen for one in said)
    one_way = [abs(angle) for angle in stated]
    with pytest.raises(ValueError, match="turned the other way in turn 2, 4, 6"):
        calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=one_way)


def test_whole_turns_show_the_lean_of_a_table_that_headings_hide():
    f, w, rate, truth, motion = table(610080, turns=(360.0, -360.0))
    turns = [angle for _, _, angle in motion.turns]
    a = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces", turns_deg=turns).accelerometer
    z = np.append((a.S - truth.S_f) / a.sigma_S, (a.b - truth.b_f) / a.sigma_b)
    # Twelve scores; six placements agree by chance: from headings alone z was 12.7.
    assert np.abs(z).max() < 4.0
    assert np.mean(np.square(z)) > 0.1, "bars that say nothing would pass as well"


@pytest.fixture
def solved(monkeypatch):
    """The session solutions that calibrations came from, in turn."""
    kept, plain = [], solved_session.solve_session

    def kept_too(*given):
        kept.append(plain(*given))
        return kept[-1]

    monkeypatch.setattr(solved_session, "solve_session", kept_too)
    return kept


@pytest.mark.parametrize("seed", [820058, pytest.param(820032, marks=pytest.mark.slow)])
def test_a_velocity_that_is_not_heard_says_nothing_by_way_of_its_noise(seed, solved):
    # Ten readings a second of a hand that trembles: moves and velocities miss by tens of standard errors.
    f, w, rate, truth, _ = hand(seed, rate_hz=10.0)
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G)
    solution = solved[-1]
    assert solution.inflation[0] > 10.0
    assert solution.inflation[1] == pytest.approx(NO_WEIGHT)
    domain, leverage = solution.core.labels[:, 0], solution.core.leverage()
    # Widened along with gravity, as one error common to both, velocities showed six of the gyro's nine parameters.
    assert leverage[domain == DYNAMICS].sum() < 0.1
    assert leverage[domain == MOVES].sum() > 8.9
    # Moves count as uncertain as they miss, not a third less; a likeliest excess counts rows, χ² degrees of freedom.
    tilts = (domain == MOVES) & (solution.core.labels[:, 3] == 0)
    weight = solution.core.tails[solution.core.labels[tilts, 1]]
    assert weight @ solution.core.residual[tilts] ** 2 / solution.moves_dof < 1.2
    z = (result.gyroscope.S - lower(truth).S_w) / result.gyroscope.sigma_S
    # Nine parameters of one session are within 3.5 in all but one of two hundred sessions.
    assert np.abs(z).max() < 3.5


def test_samples_whose_loss_the_stamps_show_widen_the_gyro_by_what_they_hide():
    wider, scores = [], []
    for seed in range(2):
        f, w, rate, truth, _ = hand(seed + 840100)
        t = np.arange(len(f)) / rate
        kept = np.random.default_rng([14, seed]).random(len(t)) >= 0.03
        whole = calibrate(recorded(f, w, rate), gravity_m_s2=G)
        part = calibrate(recorded(f[kept], w[kept], rate, t[kept]), gravity_m_s2=G)
        wider.append(np.median(part.gyroscope.sigma_S / whole.gyroscope.sigma_S))
        scores.append((part.gyroscope.S - lower(truth).S_w) / part.gyroscope.sigma_S)
    # A cubic through four samples crosses a lost one of a smooth move nearly without error.
    assert max(wider) < 1.2
    # 18 numbers of two sessions: rms 1 ± 0.17, each session's nine being weakly correlated.
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4


def test_nine_poses_are_as_certain_as_their_moves_let_them_be():
    """Nine lengths of gravity separate no spread of the bias from none: moves that are not bent do."""
    scores = []
    for seed in range(3):
        f, w, rate, truth, _ = hand(850100 + seed, n_poses=9)
        result = calibrate(recorded(f, w, rate), gravity_m_s2=G)
        low = np.tril_indices(3)
        of_S = (result.accelerometer.S - lower(truth).S_f)[low] / result.accelerometer.sigma_S[low]
        scores.append([*of_S, *((result.accelerometer.b - lower(truth).b_f) / result.accelerometer.sigma_b)])
    rms = np.sqrt(np.mean(np.square(scores)))
    # 27 numbers, correlated within a session: 1 +- 0.3.
    assert 0.55 < rms < 1.4


def test_zeros_that_wander_as_consumer_parts_do_are_no_physics():
    f, w, rate, _, _ = hand(9002, move_s=1.5, gyro_flicker=np.radians(20.0 / 3600.0), accel_flicker=0.3e-3 * G)
    # The Earth turns below the body, and may show.
    assert {one.id for one in diagnose(recorded(f, w, rate), gravity_m_s2=G).effects} <= {"earth-rate"}


def log(seed, share=(0.0, 0.0, 0.0), tau_s=2.0, drift=0.0, tilt_rad=0.0):
    """Accelerometer (n, 3) of poses in random directions: a ``share`` of each change of force that comes late, a
    ``drift`` [m/s²] over the log, and supports that give way by ``tilt_rad``."""
    rng = np.random.default_rng(seed)
    up = rng.normal(size=(N_POSES, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    parts = []
    for before, here in zip(np.vstack([up[:1], up[:-1]]), up, strict=True):
        x = np.linspace(0.0, 1.0, int(MOVE_S * RATE_HZ))[:, None]
        path = before * (1.0 - x) + here * x + 0.3 * np.sin(np.pi * x) * rng.normal(size=3)
        t = np.arange(POSE_S * RATE_HZ)[:, None] / RATE_HZ
        across = np.cross(here, rng.normal(size=3))
        across /= np.linalg.norm(across)
        lean = tilt_rad * rng.choice([-1.0, 1.0]) * np.exp(-t / 1.5)
        rest = here * np.cos(lean) + across * np.sin(lean)
        parts += [9.81 * path / np.linalg.norm(path, axis=1)[:, None], 9.81 * rest]
    force = np.concatenate(parts[1:])
    keep = np.exp(-1.0 / (RATE_HZ * tau_s))
    late = lfilter([1.0 - keep], [1.0, -keep], force - force[0], axis=0) + force[0]
    force = force + np.array(share) * (late - force)
    force = force + drift * np.linspace(0.0, 1.0, len(force))[:, None] + NOISE * rng.normal(size=force.shape)
    time_s = np.arange(len(force)) / RATE_HZ
    return trihedron.Recording(time_s, force, None, RATE_HZ, accelerometer_unit="m/s^2")


def found(recording):
    """The finding, if any."""
    findings = trihedron.segment(recording).findings
    return next((one for one in findings if one.code == "bias-settling"), None)


@pytest.mark.parametrize("seed", range(3))
def test_an_accelerometer_that_settles_after_rotations_is_found_and_its_calibration_is_of_the_settled_one(seed):
    share = np.array([0.005, 0.001, 0.003])
    recording = log(seed, share=share)
    one = found(recording)
    assert one is not None
    size = 1e-2 * np.array([one.numbers[f"{axis}_percent"] for axis in "xyz"])
    # Beside its σ at one time constant, that of the time constant itself.
    assert np.abs(size - share).max() < 0.04 * one.numbers["sigma_percent"] + 0.1 * share.max()
    result = trihedron.calibrate(recording, gravity_m_s2=9.81)
    lower = np.tril_indices(3)
    z = (result.accelerometer.S - np.eye(3))[lower] / result.accelerometer.sigma_S[lower]
    # Means that are not corrected put S_xx off by 0.1 %, seven standard errors.
    assert np.abs(z).max() < 4.0
    assert result.is_trustworthy


def test_drift_noise_and_yielding_supports_are_no_settling_accelerometer():
    logs = [log(seed, drift=0.05, tilt_rad=2e-3 * (seed % 2)) for seed in range(100, 120)]
    # Each is a false alarm once in a thousand.
    assert sum(found(one) is not None for one in logs) == 0


def test_error_along_the_vertical_is_the_noise_alone_where_poses_settle():
    white = NOISE / np.sqrt(POSE_S * RATE_HZ)
    found = [trihedron.segment(log(seed, tilt_rad=3e-3)) for seed in range(5)]
    # Settling by 30 mm/s² shows on the axes. Along the vertical the relation of 18 poses is ± 10 %, but one session
    # in thirty looks like flicker and counts twice: the middle one of five.
    assert min(np.median(one.accelerometer_sigma_mean) for one in found) > 2.0 * white
    along = [np.median(one.accelerometer_sigma_up) for one in found]
    assert 0.85 * white < np.median(along) < 1.3 * white


def test_motion_hidden_by_long_gaps_is_as_uncertain_as_it_is():
    # Bursts of 50 to 400 ms, 30 % of the log: many hide the middle of a move, which turns faster than its ends.
    f, w, rate, truth, _ = hand(5001)
    rng, kept = np.random.default_rng([77, 5001]), np.ones(len(f), dtype=bool)
    while kept.mean() > 0.7:
        start = rng.integers(0, len(f))
        kept[start : start + rng.integers(5, 40)] = False
    result = calibrate(recorded(f[kept], w[kept], rate, np.flatnonzero(kept) / rate), gravity_m_s2=G)
    z, _ = gyro_z(result, lower(truth))
    assert np.abs(z).max() < 4.0
    assert np.sqrt(np.mean(z**2)) < 1.8
