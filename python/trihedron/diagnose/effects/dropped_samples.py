"""Samples lost without a gap in the timestamps: the two sides join only if samples are inserted (eq. 8.16)."""

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.effects.saturation import clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Distortion, solved
from trihedron.probability import LN_FAULT
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where
from trihedron.session.joints import joints, most_lost
from trihedron.session.noise import ANYTHING, START_STRENGTHS
from trihedron.session.rounding import UNIFORM


@dataclass(frozen=True)
class Loss:
    """Samples missing behind ``sample`` of ``move``: their number with its standard error, and twice the log-likelihood
    that they gain."""

    sample: int
    move: int
    count: int
    gain: float
    sigma: float = 0.0


def counted_losses(context: Context) -> list[Loss]:
    """Losses in order, with the counts that gravity and zero velocity after the moves determine (eq. 8.16b).

    The joint of the two sides of a gap gives the place and an approximate count (eq. 8.16). A lost sample takes the
    motion at its place from the integrals of its move: its count is a parameter of the session, fitted with all others.
    A jolt looks like a loss; its count is none. The weakest are left out one by one while the odds are against them.
    """
    obs, moves = context.obs, np.array(context.obs.move_ranges, dtype=np.int64).reshape(-1, 2)
    found = joints(list(obs.whitened), obs.time_s, obs.recording.rate_hz, moves, clipped_samples(obs))
    owner = np.searchsorted(moves[:, 0], found.sample, side="right") - 1
    each = zip(found.sample.tolist(), owner.tolist(), found.count.tolist(), (2.0 * found.gain).tolist(), strict=True)
    losses = [Loss(*one) for one in sorted(each)]
    if not losses:
        return []
    size, begin = np.array([float(loss.count) for loss in losses]), (context.fitted.state, context.fitted.prior)
    columns = _of_each(context, losses)
    fitted = solved(obs, *begin, columns, START_STRENGTHS, ANYTHING, size)
    precision = np.linalg.inv(fitted.covariance()[-len(losses) :, -len(losses) :])
    slope, kept = precision @ fitted.state.effect[-len(losses) :], list(range(len(losses)))
    while kept:
        covariance = np.linalg.inv(precision[np.ix_(kept, kept)])
        value, sigma = covariance @ slope[kept], sigmas_of(covariance)
        weakest = int(np.argmin(value / sigma))
        if value[weakest] > math.sqrt(2.0 * LN_FAULT) * sigma[weakest]:
            break
        del kept[weakest]
    most, rounded = most_lost(obs.recording.rate_hz), math.sqrt(UNIFORM)
    out = []
    for k, n, error in zip(kept, value, sigma, strict=False):
        count, gain = round(min(max(float(n), 1.0), most)), losses[k].gain + float(n / error) ** 2
        out.append(replace(losses[k], count=count, gain=gain, sigma=math.hypot(error, rounded)))
    return out


def _of_each(context: Context, losses: list[Loss]) -> Distortion:
    """Columns of lost samples: one sample interval more of the motion at each loss, shared by the readings beside it.

    Gravity is in the force of that interval too: the velocity gained is what counts.
    """

    def side(motion: FloatArray) -> FloatArray:
        columns = np.zeros((context.n_points, 3, len(losses)))
        for k, loss in enumerate(losses):
            first = context.move_edges[loss.move, 0] + loss.sample - context.obs.move_ranges[loss.move][0]
            columns[first : first + 2, :, k] = -0.5 * motion[first : first + 2].mean(axis=0)
        return columns

    return Distortion(side(context.force - context.gravity_in_moves), side(context.rate))


def with_gaps(obs: Observations, losses: list[Loss]) -> Observations:
    """The observations with lost samples, which their timestamps show: the integrals over such a gap are as uncertain
    as the motion beside it leaves them (eq. 11.6b)."""
    extra = np.zeros(len(obs.time_s))
    extra[[loss.sample + 1 for loss in losses]] = [loss.count for loss in losses]
    time_s = obs.time_s + np.cumsum(extra) / obs.recording.rate_hz
    middle = np.array([0.5 * (time_s[pose.start] + time_s[pose.stop - 1]) for pose in obs.segments.poses])
    recording = obs.recording.with_same_readings(time_s=time_s)
    return replace(obs, time_s=time_s, pose_time_s=middle, recording=recording)


class DroppedSamples(DirectEffect):
    """Both sensors skip the same whole number of samples at once; with these inserted the motion is smooth."""

    id = "dropped-samples"
    needs_moves = True
    of_session = None

    def find(self, context: Context) -> Evidence | None:
        losses = counted_losses(context)
        if not losses:
            return None
        obs, t = context.obs, context.obs.time_s
        total = math.hypot(*(loss.sigma for loss in losses))
        parameters = (
            EffectParameter("events", float(len(losses)), 0.0, "1"),
            EffectParameter("samples_lost", float(sum(loss.count for loss in losses)), total, "1"),
            *(EffectParameter(f"lost_at_{t[k.sample]:.2f}s", float(k.count), k.sigma, "samples") for k in losses),
        )
        largest = sorted(losses, key=lambda loss: -loss.count)
        statement = self.reported("losses", losses=[(loss.count, t[loss.sample]) for loss in largest])
        where = Where(
            (),
            tuple(dict.fromkeys(obs.move_names([loss.move for loss in losses]))),
            tuple((float(t[loss.sample]), float(t[loss.sample + 1])) for loss in losses),
        )
        gain, clearest = sum(loss.gain for loss in losses), max(loss.gain for loss in losses)
        # Corrected for all intervals and counts.
        n_intervals = sum(b - a for a, b in obs.move_ranges)
        p = math.exp(-0.5 * clearest) * n_intervals * most_lost(obs.recording.rate_hz)
        return Evidence(p, gain, parameters, statement, "timing", where, reweigh=lambda old: with_gaps(old, losses))
