"""A pose that was disturbed or not static: a property of the experiment, not of the sensor."""

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence, Variant, acting_on, per_axis
from trihedron.diagnose.residuals.goodness_of_fit import LEAST_DOF
from trihedron.diagnose.residuals.within_poses import loud_poses, pose_scatter
from trihedron.diagnose.session.observations import LOUD, Observations
from trihedron.probability import LEAST_P, RARE_ALARM, SURE, chdtri
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import HeldOut, Where
from trihedron.records.words import Words
from trihedron.session.model import STATIC_ACCEL

BUMP_SIGMA = 7.0
"""Deviation of a 0.1 s mean from the line through its surroundings, in sigma: drift inside a pose stays below it."""


def _bump(obs: Observations, span: tuple[float, float]) -> HeldOut | None:
    """Deviation of the readings in ``span`` [s] from the straight line through the readings before and after it.

    Chi-square per 0.1 s block and channel inside and outside the span; ``None`` below 7 sigma, where it is no larger
    inside, or with too few blocks.
    """
    rate = obs.recording.rate_hz
    a, b = (int(k) for k in np.searchsorted(obs.time_s, span))
    side = max(int(0.5 * rate), 5)
    block = max(int(0.1 * rate), 2)
    first, last = max(a - side, 0), min(b + side, len(obs.time_s))
    # Two blocks on either side at least determine the line.
    n, edge = (last - first) // block, max(side // block, 2)
    if n < 4:
        return None
    k = np.arange(n)
    outer = (k < edge) | (k >= n - edge)
    readings = np.hstack([values[first : first + n * block] for values in obs.whitened])
    means = readings.reshape(n, block, -1).mean(axis=1)
    line = np.polynomial.polynomial.polyfit(k[outer], means[outer], 1)
    away = (means - (line[0] + np.outer(k, line[1]))) * np.sqrt(block)
    middle = away if outer.all() else away[~outer]
    before, after = float(np.mean(middle**2)), float(np.mean(away[outer] ** 2))
    # Neither holds of missing readings.
    if not (np.abs(away).max() > BUMP_SIGMA and before > after):
        return None
    return HeldOut("within-static", before, after, float(np.sqrt(before)), float(np.sqrt(after)), "sigma")


def _restless(obs: Observations) -> tuple[list[int], HeldOut | None]:
    """Poses that vibrate throughout, and how the level of one half predicts the other half, against the usual level."""
    scatter = pose_scatter(obs)
    loud = loud_poses(obs) < RARE_ALARM
    x = obs.readings
    found, before, after = [], [], []
    for i in np.flatnonzero(loud.any(axis=1)):
        pose = obs.segments.poses[i]
        steps = np.diff(x[pose.start : pose.stop][:, loud[i]], axis=0)
        early, late = (np.nanvar(half, axis=0) for half in np.array_split(steps, 2))
        usual = np.nanvar(steps, axis=0) / scatter.ratio[i, loud[i]]
        # Vibration is in both halves of its pose, half as loud at least; a disturbance is in one of them.
        if (2.0 * np.minimum(early, late) > LOUD * usual).any():
            found.append(int(i))
            before.append(float(np.mean(late / usual)))
            after.append(float(np.mean(late / early)))
    if not found:
        return [], None
    return found, HeldOut("within-static", float(np.mean(before)), float(np.mean(after)), 0.0, 0.0, "")


def _shows_itself(context: Context) -> npt.NDArray[np.bool_]:
    """(poses,) whether a disturbance shows: in the norm of a pose's readings, between its halves, or in both moves
    beside it, which are in the tails of the noise that fits the others."""
    obs, fitted = context.obs, context.fitted
    rows = np.flatnonzero((fitted.system.domain == STATIC_ACCEL) & (fitted.system.walk == 0))
    poses, free = fitted.system.segment[rows], 1.0 - fitted.leverage[rows]
    chi2 = np.bincount(poses, fitted.system.residual[rows] ** 2, minlength=obs.n_poses)
    dof = np.maximum(np.bincount(poses, free, minlength=obs.n_poses), LEAST_DOF)
    out: npt.NDArray[np.bool_] = chi2 > SURE**2 * dof
    for raw, sigma in ((obs.raw_force, obs.pose_force_sigma), (obs.raw_rate, obs.pose_rate_sigma)):
        if raw is not None and sigma is not None:
            # Each half's mean has twice the variance of the whole's, their difference four times.
            out |= (np.abs(_core.half_changes(raw, obs.segments.spans)) > 2.0 * SURE * sigma).any(axis=1)
    # Weight of a move below which its five residuals are in the tails (eq. 11.18a).
    before, after = obs.move_poses[fitted.core.tails < 9.0 / (4.0 + chdtri(5, RARE_ALARM))].T
    out[np.intersect1d(before, after)] = True
    return out


class DisturbedPose(DirectEffect):
    """A disturbance detected inside a pose, or one pose with an acceleration of its own."""

    id = "disturbed-pose"
    size = 0.05
    """m/s²: a push too weak to be noticed by hand."""
    of_session = None
    is_local = True

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        found = obs.times((a, min(b + 1, len(obs.time_s))) for pose in obs.whole.poses for a, b in pose.disturbed)
        bumps = {span: bump for span in found if (bump := _bump(obs, span)) is not None}
        disturbed = list(bumps)
        held = (max(bumps.values(), key=lambda bump: bump.chi2_per_dof_before),) if disturbed else ()
        restless, predicted = _restless(obs)
        if restless and predicted is not None:
            held = (*held, predicted)
        if not disturbed and not restless:
            return None
        spans = (*disturbed, *obs.times(obs.segments.spans[restless]))
        # The session state already excludes the disturbance: rank it behind effects that improve the fit.
        strength = 10.0 * (len(disturbed) + len(restless))
        names = list(dict.fromkeys(obs.pose_names(restless)))
        statement = self.reported(
            "not-still", is_timed=bool(disturbed), disturbed_s=[(0.5 * (a + b),) for a, b in disturbed],
            is_restless=bool(restless), restless=names, are_both=bool(disturbed and restless),
        )  # fmt: skip
        parameters = tuple(EffectParameter("pose_at", 0.5 * (a + b), 0.5 * max(b - a, 0.1), "s") for a, b in spans[:6])
        return Evidence(
            LEAST_P, strength, parameters, statement, "within-static",
            Where((), obs.pose_names(restless), spans), held, share=min(len(spans) / obs.n_poses, 1.0),
        )  # fmt: skip

    def variants(self, context: Context) -> list[Variant]:
        out = []
        for i in np.flatnonzero(_shows_itself(context)):
            columns = np.zeros((context.n_points, 3, 3))
            columns[i] = np.eye(3)
            (name,) = context.obs.pose_names([int(i)])
            # Numbered as in the recording, from 1: an earlier pose may have been cut at a disturbance.
            shape = {"pose": (float(name.removeprefix("pose ")) if name.startswith("pose ") else i + 1.0, "number")}
            out.append(Variant(acting_on(0, columns), per_axis("push"), ("m/s^2",) * 3, shape, name))
        return out

    def statement(self, parameters: tuple[EffectParameter, ...]) -> Words:
        pose = next(p.value for p in parameters if p.name == "pose")
        size = float(np.sqrt(sum(p.value**2 for p in parameters if p.name.startswith("push"))))
        return self.reported("moved", pose=pose, off=size)
