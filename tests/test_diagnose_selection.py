"""Rules of acceptance: what joins the model, what leaves it again, what is named first."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from trihedron.diagnose import diagnose_recording
from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.joint import calibrate_joint
from trihedron.segment import resegment, segment_recording
from trihedron.session.coloured_noise import coloured_variance
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.named import _of
from trihedron.simulate.profiles import profile_by_name


def diagnosed(effect_id, seed, **size):
    scenario = with_effect(
        _of(profile_by_name("mpu"), hand_session(20, layout=seed), "session", seed), effect_id, **size
    )
    recording, truth = simulate(scenario, seed)
    segments = segment_recording(recording)
    accelerometer, _ = calibrate_norm(
        segments.accelerometer_mean,
        segments.accelerometer_sigma_mean,
        truth.gravity_m_s2,
        raw_unit=recording.accelerometer_unit,
    )
    calibration = calibrate_joint(recording, segments, accelerometer, truth.gravity_m_s2, "simulated")
    return diagnose_recording(recording, resegment(recording, segments), calibration)


@pytest.mark.parametrize("delay_s", [0.04, pytest.param(-0.025, marks=pytest.mark.slow)])
def test_a_long_delay_is_a_delay_of_that_length(delay_s):
    d = diagnosed("accel-gyro-time-offset", 4, offset_s=delay_s)
    first = d.effects[0]
    assert first.id == "accel-gyro-time-offset"
    # 40 ms were called 26 ms and a lag of -14 ms; half a millisecond is a twentieth of a sample.
    assert first.parameters[0].value == pytest.approx(delay_s, abs=5e-4)
    assert not any(p.name.endswith("_lag") and p.value < 0.0 for e in d.effects for p in e.parameters)
    for effect in d.effects:  # nothing whose size is unknown
        assert any(abs(p.value) > p.std for p in effect.parameters), effect.id
        assert effect.share is None or 0.0 <= effect.share <= 1.0


def test_white_noise_has_no_colour_and_a_zero_that_jumps_in_some_poses_is_bounded():
    rng = np.random.default_rng(8)
    density, lasts = np.full(3, 0.1), np.full(40, 4.0)
    sigma = np.full((40, 3), 0.1 / np.sqrt(4.0))
    move_s = 2.0
    slow = []
    for _ in range(100):
        halves = rng.normal(size=(40, 3)) * 2.0 * sigma
        assert coloured_variance(sigma, halves, density, lasts, np.array([move_s])) == pytest.approx(0.0, abs=1e-12)
        # Error bars four times as wide because a quarter of the poses jumped: the quiet ones bound what is slow noise.
        jumping = np.where(rng.random((40, 1)) < 0.25, 12.0 * sigma, 0.0)
        slow.append(coloured_variance(4.0 * sigma, halves + jumping, density, lasts, np.array([move_s])))
    as_error_bars_say = (4.0**2 - 1.0) * move_s * 0.1**2
    assert float(np.mean(slow)) < 0.5 * as_error_bars_say  # 2.5 times the quiet poses' own, which is near one


def scattering(effect_id, seed, gyro_deg_s, **size):
    """A session with an effect whose gyro's zero is another in every pose, and gravity there."""
    scenario = with_effect(
        _of(profile_by_name("mpu"), hand_session(24, layout=seed), "session", seed), effect_id, **size
    )
    recording, truth = simulate(scenario, seed)
    rng, zero = np.random.default_rng(seed), np.zeros_like(recording.gyroscope)
    starts = [part.start for part in truth.segments if part.kind == "hold"]
    for start, stop in zip(starts, [*starts[1:], len(zero)], strict=True):
        zero[start:stop] = rng.normal(size=3) * np.radians(gyro_deg_s) / np.radians(1.0 / 131.0)
    return replace(recording, gyroscope=recording.gyroscope + zero), truth.gravity_m_s2


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_a_flaw_of_moves_is_not_swallowed_by_zeros_that_scatter(seed):
    recording, gravity = scattering("gyro-scale-nonlinearity", seed, 0.07, c3=(3e-3, -3e-3, 3e-3))
    found = trihedron.diagnose(recording, gravity_m_s2=gravity)
    names = [effect.id for effect in found.effects]
    # The scatter may stray between poses as far as moves show: without its cost it explained the moves alone.
    assert names[0] == "gyro-scale-nonlinearity"
    assert "gyro-zero-scatter" in names
