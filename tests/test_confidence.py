"""Sessions of an independent generator (benches/confidence): within their bars, or marked, whatever the motion."""

import numpy as np
import pytest

from confidence.machine import robot
from confidence.motion import G
from confidence.sensor import lower, recorded
from confidence.sessions import hand, manual, table
from trihedron import calibrate
from trihedron.records import FindingCode


def with_losses(f, w, seed, share=0.03):
    """Readings of a link that drops packets, numbered anew."""
    kept = np.random.default_rng([14, seed]).random(len(f)) >= share
    return f[kept], w[kept]


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
    result = calibrate(
        recorded(f, w, rate),
        gravity_m_s2=G,
        method="faces",
        turns_deg=stated,
        gyroscope_nominal=2.0 * truth.S_w[0, 0],
    )
    z, relative = gyro_z(result, truth)
    assert np.abs(z).max() < 4.0
    assert relative < 1e-3
    # Unstated ones are read by gravity, not by a common divisor: rightly, or not at all and said so.
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces")
    if result.gyroscope is None:
        assert FindingCode.TURN_ANGLE_UNKNOWN in {finding.code for finding in result.findings}
        assert not result.is_trustworthy
    else:
        assert np.abs(result.gyroscope.S - truth.S_w).max() < 1e-3 * truth.S_w[0, 0]


def test_the_manuals_session_by_stated_turns_about_any_axis_lies_inside_its_bars():
    f, w, rate, truth, motion = manual(3)
    stated = [angle for _, _, angle in motion.turns]
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=stated)
    z, relative = gyro_z(result, lower(truth))
    assert np.abs(z).max() < 4.0
    # Four whole turns: the scale to a few parts in ten thousand, as far as the axes are known.
    assert relative < 5e-4
    with pytest.raises(ValueError, match="5 turns were stated and 6 were found"):
        calibrate(recorded(f, w, rate), gravity_m_s2=G, turns_deg=stated[:5])


def test_lost_samples_with_stamps_remade_are_seen_through_ringing():
    seed = 41
    f, w, rate, _, _ = robot(seed, n_poses=12)
    result = calibrate(recorded(*with_losses(f, w, seed), rate), gravity_m_s2=G)
    lost = [finding for finding in result.findings if finding.code is FindingCode.SAMPLES_LOST]
    assert lost
    assert not result.is_trustworthy
    # 3 % were lost; a ringing arm shows some of them only: within four of the share's own standard errors.
    seen = lost[0].numbers
    assert abs(seen["lost_share"] - 0.03) < 4.0 * seen["sigma_lost_share"]
    assert seen["sigma_lost_share"] < 0.04


def test_moves_through_hundreds_of_degrees_need_no_nominal_scale():
    # Turns of up to 360° one after another between two poses.
    f, w, rate, truth, _ = robot(43, n_poses=14, speed_deg_s=300.0)
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G)
    assert result.is_trustworthy
    z, relative = gyro_z(result, lower(truth))
    assert np.abs(z).max() < 4.0
    assert relative < 0.01


def test_whole_turns_show_the_lean_of_a_table_that_headings_hide():
    f, w, rate, truth, motion = table(610080, turns=(360.0, -360.0))
    turns = [angle for _, _, angle in motion.turns]
    a = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces", turns_deg=turns).accelerometer
    z = np.append((a.S - truth.S_f) / a.sigma_S, (a.b - truth.b_f) / a.sigma_b)
    # Twelve scores; six placements agree by chance: from headings alone z was 12.7.
    assert np.abs(z).max() < 4.0
    assert np.mean(np.square(z)) > 0.1, "bars that say nothing would pass as well"


def test_losses_that_no_step_shows_are_in_the_error_bars_and_said():
    # At 1000 Hz a lost sample is below the noise of a reading, and each move lost two of its 2000: 0.1 % of the scale,
    # ten standard errors of the bars without them.
    f, w, rate, truth, _ = hand(400, rate_hz=1000.0)
    result = calibrate(recorded(*with_losses(f, w, 400, 0.001), rate), gravity_m_s2=G)
    z, _ = gyro_z(result, lower(truth))
    assert np.abs(z).max() < 4.5
    assert FindingCode.LOSSES_POSSIBLE in {finding.code for finding in result.findings}
    assert not result.is_trustworthy


def test_a_machine_that_always_turns_at_one_speed_is_not_at_its_gyros_limit():
    # Half a degree per second a step: its top speed is one code. Bridged as if cut, scales were wrong by a fifth.
    f, w, rate, truth, _ = robot(3000, gyro_bits=12)
    result = calibrate(recorded(f, w, rate), gravity_m_s2=G)
    assert FindingCode.CLIPPING not in {finding.code for finding in result.findings}
    if result.gyroscope is not None and result.is_trustworthy:
        z, relative = gyro_z(result, lower(truth))
        assert np.abs(z).max() < 4.0
        assert relative < 5e-3
