"""Static rates caused by motion: a soft support rotates the sensor, and gravity shows it (eq. 8.7d)."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from trihedron import _core
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import Observations
from trihedron.session.noise import FEWEST_POSES


class Settling(NamedTuple):
    """``score``: twice the log-likelihood that settling gains over scatter, less the cost of the time constants tried;
    ``of_bias`` the same of a bias that settles, over both; ``rate_rad_s``: standard deviation of the settling rate at
    the start of poses, ``tau_s`` its time constant.
    """

    score: float
    rate_rad_s: float
    tau_s: float
    of_bias: float


def settling(context: Context) -> Settling | None:
    """Settling against scatter in the rates of the poses: w = z + s + k exp(-t/τ), tilt k τ (1 - exp(-t/τ)), or none
    where the bias settles (eq. 8.7d).

    ``None`` without a gyro, or with too few poses.
    """
    obs, state = context.obs, context.fitted.state
    if obs.raw_rate is None or obs.pose_rate_noise is None:
        return None
    found = _core.settling_of_poses(
        (obs.raw_rate, obs.raw_force), (state.gyro_S, state.accel_S), (obs.pose_rate_noise, obs.pose_force_sigma),
        state.up, np.array([(pose.start, pose.stop) for pose in obs.segments.poses]),
        gravity_m_s2=state.gravity, step_s=1.0 / obs.recording.rate_hz, fewest=FEWEST_POSES,
    )  # fmt: skip
    return None if found is None else Settling(*found)


def with_settling(context: Context, found: Settling) -> Observations:
    """Observations with the noise of static rates, and of the verticals at the ends of moves, widened by settling: the
    ends of a settling pose differ from its mean (eq. 8.7f). The test of static rates still uses their own noise.
    """
    obs = context.obs
    assert obs.pose_rate_sigma is not None
    lasts = np.array([pose.stop - pose.start for pose in obs.segments.poses]) / obs.recording.rate_hz
    fades = np.exp(-lasts / found.tau_s)
    mean = found.tau_s * (1.0 - fades) / lasts
    turned = found.rate_rad_s * found.tau_s
    begins, ends = turned * (1.0 - mean), turned * (mean - fades)
    si_per_raw = context.si_per_raw(1)
    unresolved = dict(obs.unresolved)
    for before, after in obs.move_poses:
        key = int(before), int(after)
        wider = np.zeros((4, 3)) if key not in unresolved else unresolved[key].copy()
        wider[3] += (ends[before] ** 2 + begins[after] ** 2) / si_per_raw**2
        unresolved[key] = wider
    settles = found.rate_rad_s * mean[:, None] / si_per_raw
    return replace(
        obs, unresolved=unresolved, pose_rate_sigma=np.hypot(obs.pose_rate_sigma, settles), pose_settling=settles
    )
