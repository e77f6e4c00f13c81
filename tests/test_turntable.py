"""A table that turns at known speeds, the unit on it anyhow: an own generator, with an arm and a table out of level."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from confidence.sensor import Truth as ConfidenceTruth
from confidence.sensor import lower
from trihedron import calibrate, segment
from trihedron.records import Recording

G, RATE_HZ, DEG = 9.81, 100.0, np.pi / 180.0


@cache
def segmented(seed):
    """A recording in counts, its segments and truth: rest, a turn about the table's axis, rest, by hand to any pose."""
    rng = np.random.default_rng(seed)
    axis = Rotation.from_euler("x", 0.5, degrees=True).apply([0.0, 0.0, 1.0])
    now = Rotation.random(random_state=seed)
    attitudes, pulls = [], []

    def add(turned, pull=None):
        attitudes.append(turned.as_quat())
        pulls.append(np.zeros((len(turned), 3)) if pull is None else pull)

    still = int(4.0 * RATE_HZ)
    for k, speed in enumerate([45.0, 90.0, -180.0] * 4):
        add(Rotation.concatenate([now] * still))
        ramp = np.linspace(0.0, 1.0, int(RATE_HZ))
        rate = np.concatenate([ramp, np.ones(int(8.0 * RATE_HZ)), ramp[::-1]]) * speed * DEG
        turned = Rotation.from_rotvec(axis * (np.cumsum(rate) / RATE_HZ)[:, None]) * now
        w = axis * rate[:, None]
        add(turned, np.cross(w, np.cross(w, turned.apply(0.03 * rng.normal(size=3)))))
        now = turned[-1]
        add(Rotation.concatenate([now] * still))
        after = Rotation.random(random_state=1000 * seed + k)
        s = np.linspace(0.0, 1.0, int(2.0 * RATE_HZ))[:, None]
        add(Rotation.from_rotvec((after * now.inv()).as_rotvec() * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)) * now)
        now = after
    add(Rotation.concatenate([now] * still))
    R = Rotation.from_quat(np.concatenate(attitudes))
    step = (R[:-1].inv() * R[1:]).as_rotvec() * RATE_HZ
    w = np.vstack([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
    f = R.inv().apply(np.concatenate(pulls) + np.array([0.0, 0.0, G]))
    own_w, own_f = np.eye(3) + 0.02 * rng.normal(size=(3, 3)), np.eye(3) + 0.01 * rng.normal(size=(3, 3))
    b_w, b_f = rng.normal(size=3) * DEG, 0.2 * rng.normal(size=3)
    lsb_w, lsb_f = 1000.0 * DEG / 2**16, 8.0 * G / 2**16
    raw_w = np.round((w @ own_w.T + b_w + 0.1 * DEG * rng.normal(size=w.shape)) / lsb_w)
    raw_f = np.round((f @ own_f.T + b_f + 0.02 * rng.normal(size=f.shape)) / lsb_f)
    inverse_w, inverse_f = np.linalg.inv(own_w), np.linalg.inv(own_f)
    truth = ConfidenceTruth(inverse_f * lsb_f, -inverse_f @ b_f, inverse_w * lsb_w, -inverse_w @ b_w)
    units = {"accelerometer_unit": "counts", "gyroscope_unit": "counts"}
    recording = Recording(np.arange(len(raw_w)) / RATE_HZ, raw_f, raw_w, RATE_HZ, **units)
    return recording, segment(recording), lower(truth)


def test_known_speeds_in_unknown_orientations_make_a_gyro_three_times_as_certain():
    scores = []
    for recording, segments, truth in (segmented(0), segmented(1)):
        plain = calibrate(recording, segments=segments, gravity_m_s2=G).gyroscope
        result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0] * 4)
        gyro = result.gyroscope
        assert result.is_trustworthy
        assert np.mean(np.diag(plain.sigma_S) / np.diag(gyro.sigma_S)) > 2.5
        assert np.linalg.eigvalsh(result.calibration.covariance).min() > -1e-18
        scores += [*((gyro.S - truth.S_w) / gyro.sigma_S).ravel(), *((gyro.b - truth.b_w) / gyro.sigma_b)]
    # 12 scores a unit, as good as independent: their mean square within four standard errors of 1.
    assert abs(np.mean(np.square(scores)) - 1.0) < 4.0 * np.sqrt(2.0 / len(scores))
    assert np.abs(scores).max() < 4.0


def test_the_uncertainty_of_the_speed_is_in_every_scale():
    recording, segments, truth = segmented(0)
    said = [45.09, 90.18, -180.36] * 4
    stated = {"turntable_deg_s": said, "turntable_sigma": 0.002}
    gyro = calibrate(recording, segments=segments, gravity_m_s2=G, **stated).gyroscope
    assert np.abs((gyro.S - truth.S_w) / gyro.sigma_S).max() < 4.0
    # Two parts in a thousand beside one in ten thousand from the moves: the table shows what axes have to each other.
    assert np.diag(gyro.sigma_S / gyro.S).min() > 5e-5


def test_speeds_that_the_rest_of_the_log_contradicts_are_said_and_do_no_harm():
    recording, segments, truth = segmented(0)
    result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[47.0, 94.0, 188.0] * 4)
    said = next(one for one in result.findings if one.code.value == "turntable")
    # 45 °/s where 47 are stated, with a noise of a part in a thousand; rms is that of the same differences.
    assert abs(said.numbers["common_percent"] - 100.0 * (45.0 / 47.0 - 1.0)) < 0.1
    assert said.numbers["rms"] >= abs(said.numbers["common_percent"]) / 100.0
    assert np.abs((result.gyroscope.S - truth.S_w) / result.gyroscope.sigma_S).max() < 4.0


def test_another_number_of_speeds_is_refused_with_the_turns_that_were_found():
    recording, segments, _ = segmented(0)
    with pytest.raises(ValueError, match=r"3 speeds were given and 12 steady turns were found \(seconds 5\.3-"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0])
    with pytest.raises(ValueError, match="leave them, or the reference, out"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0], reference=recording)
