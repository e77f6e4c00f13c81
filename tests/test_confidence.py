"""Sessions of an independent generator (benches/confidence): within their bars, or marked, whatever the motion."""

import numpy as np
import pytest

from confidence.motion import G
from confidence.sensor import lower, recorded
from confidence.sessions import manual, table
from trihedron import calibrate
from trihedron.records import FindingCode


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


def test_whole_turns_show_the_lean_of_a_table_that_headings_hide():
    f, w, rate, truth, motion = table(610080, turns=(360.0, -360.0))
    turns = [angle for _, _, angle in motion.turns]
    a = calibrate(recorded(f, w, rate), gravity_m_s2=G, method="faces", turns_deg=turns).accelerometer
    z = np.append((a.S - truth.S_f) / a.sigma_S, (a.b - truth.b_f) / a.sigma_b)
    # Twelve scores; six placements agree by chance: from headings alone z was 12.7.
    assert np.abs(z).max() < 4.0
    assert np.mean(np.square(z)) > 0.1, "bars that say nothing would pass as well"
