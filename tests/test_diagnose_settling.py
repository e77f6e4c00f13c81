"""Static rates that are motion: supports that give are no biases that differ."""

from functools import cache

import numpy as np

import trihedron
from diagnosed_session import simulated
from trihedron.diagnose.context import Context
from trihedron.diagnose.residuals.goodness_of_fit import judge_rows
from trihedron.diagnose.residuals.settling import settling, with_settling
from trihedron.diagnose.search import threshold
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.solve import tune_noise
from trihedron.diagnose.session.starting_point import start_state
from trihedron.records import Recording
from trihedron.segment import resegment, segment_recording

NAMED = threshold(0.01)


@cache
def session(lean_rad, scatter_rad_s, seed=1):
    """Poses that lean by ``lean_rad`` within seconds of being set down, gyro biases drawn anew in each."""
    recording, truth = simulated(seed=seed, grade="tactical")
    rng = np.random.default_rng(seed)
    force, rate = recording.accelerometer.copy(), recording.gyroscope.copy()
    to_raw = np.linalg.inv(np.asarray(truth.accelerometer_S)), np.linalg.inv(np.asarray(truth.gyroscope_S))
    for part in truth.segments:
        if part.kind != "pose":
            continue
        here = slice(part.start, part.stop)
        since = recording.time_s[here] - recording.time_s[part.start]
        direction = lean_rad * rng.normal(size=3)
        up = truth.specific_force_m_s2[part.start]
        # f' = f x w for a body that turns by w: the vertical of the body goes the other way.
        force[here] += (1.0 - np.exp(-since / 2.0))[:, None] * (to_raw[0] @ np.cross(up, direction))
        turning = (np.exp(-since / 2.0) / 2.0)[:, None] * direction + rng.normal(size=3) * scatter_rad_s
        rate[here] += turning @ to_raw[1].T
    timestamps = recording.time_s
    log = Recording(
        time_s=timestamps, rate_hz=recording.rate_hz, accelerometer=force, gyroscope=rate,
        accelerometer_unit=recording.accelerometer_unit, gyroscope_unit=recording.gyroscope_unit,
    )  # fmt: skip
    segments = segment_recording(log)
    calibration = trihedron.calibrate(log, segments=segments, gravity_m_s2=truth.gravity_m_s2).calibration
    obs = observe(log, resegment(log, segments))
    return Context(obs, tune_noise(obs, start_state(obs, calibration), None))


def test_supports_that_give_are_told_from_zeros_that_scatter():
    # The accelerometer hardly sees a milliradian; the shape in time and what it does see say the same.
    for lean_rad in (0.006, 0.001):
        assert settling(session(lean_rad, 0.0)).score > NAMED
    # Scatter alone, and scatter that a support beneath it would hide from gravity.
    for lean_rad, scatter in ((0.0, 1e-3), (0.006, 1e-3)):
        assert settling(session(lean_rad, scatter)).score < NAMED


def test_moves_allow_for_poses_that_settle_and_rates_at_rest_still_disagree():
    context = session(0.006, 0.0)
    found = settling(context)
    # Drawn with 0.006 rad about each axis, gone in 2 s; the fit has a grid of factors of two for that time.
    assert 0.5 < found.rate_rad_s * found.tau_s / 0.006 < 2.0
    before, after = (
        {one.domain: one for one in judge_rows(fitted, 0.01)}
        for fitted in (
            context.fitted,
            tune_noise(with_settling(context, found), context.fitted.state, None),
        )
    )
    # Of ten sessions χ² of the moves fell to 0.43 to 0.64; in three of them it then agreed with the noise.
    assert before["moves"].disagrees
    assert after["moves"].chi2_per_dof < 0.7 * before["moves"].chi2_per_dof
    assert after["static-gyro"].disagrees
