"""Samples lost without a trace in the time stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.sample_steps import Loss, find_losses
from trihedron.diagnose.observations import Observations, observe
from trihedron.diagnose.repair import insert_samples
from trihedron.diagnose.solve import fit
from trihedron.diagnose.twin import NO_DISTORTION
from trihedron.records.diagnosis import EffectParameter, Where

MAX_COUNTED = 4
"""Losses whose number is settled by gravity; each costs a few fits."""


def counted_by_gravity(context: Context, losses: list[Loss]) -> dict[int, int]:
    """The number of samples lost at each place with which the twin predicts gravity and rest after the move best.

    The joint of the two sides tells where and roughly how many; a turn whose middle is missing tells exactly.
    """
    counts = {loss.sample: loss.count for loss in losses}
    if len(losses) > MAX_COUNTED:
        return counts
    obs = context.obs
    twin = context.fitted.twin
    if len(twin.effect):
        return counts

    def misfit(trial: dict[int, int]) -> float:
        recording, segments = insert_samples(obs.recording, obs.segments, {k: n for k, n in trial.items() if n})
        return fit(observe(recording, segments), twin, NO_DISTORTION, context.fitted.line.prior, n_iterations=2).chi2

    best = misfit(counts)
    for loss in sorted(losses, key=lambda one: -one.gain):
        for direction in (-1, 1):
            while 0 < counts[loss.sample] + direction <= 2 * loss.count + 2:
                trial = counts | {loss.sample: counts[loss.sample] + direction}
                value = misfit(trial)
                if value >= best:
                    break
                best, counts = value, trial
    return counts


class DroppedSamples(DirectEffect):
    """Both sensors jump at once by the same whole number of samples; put back, the motion is smooth again."""

    id = "dropped-samples"
    mechanism = "samples are missing though the time stamps run on evenly"
    experiment = "log the sensor's own sample counter"

    def unavailable(self, context: Context) -> str | None:
        return "the log has no moves with a gyro" if not context.moves else None

    def find(self, context: Context) -> Evidence | None:
        losses = find_losses(context)
        if not losses:
            return None
        obs = context.obs
        n_intervals = sum(b - a for a, b in obs.move_ranges)
        if len(losses) > 0.02 * n_intervals:
            return None  # everywhere is not a loss here and there
        counts = counted_by_gravity(context, losses)
        losses = [replace(loss, count=counts[loss.sample]) for loss in losses if counts[loss.sample] > 0]
        if not losses:
            return None
        counts = {loss.sample: loss.count for loss in losses}
        t = obs.time_s
        parameters = (
            EffectParameter("events", float(len(losses)), 0.0, "1"),
            EffectParameter("samples_lost", float(sum(loss.count for loss in losses)), 0.5 * np.sqrt(len(losses)), "1"),
            *(EffectParameter(f"lost_at_{t[loss.sample]:.2f}s", float(loss.count), 0.5, "samples") for loss in losses),
        )
        places = ", ".join(f"{loss.count} at {t[loss.sample]:.2f} s" for loss in losses[:4])
        more = f" and {len(losses) - 4} more" if len(losses) > 4 else ""

        def reweigh(old: Observations) -> Observations:
            recording, segments = insert_samples(old.recording, old.segments, counts)
            mended = observe(recording, segments)
            return replace(
                mended,
                moves_inflation=old.moves_inflation,
                dynamics_inflation=old.dynamics_inflation,
                jitter_s=old.jitter_s,
            )

        where = Where(
            (),
            tuple(dict.fromkeys(f"move {loss.move}" for loss in losses)),
            tuple((float(t[loss.sample]), float(t[loss.sample + 1])) for loss in losses),
        )
        gain = sum(loss.gain for loss in losses)
        # A chi-square of one degree of freedom, paid for by all intervals and counts looked at.
        weakest = min(max(loss.per_sensor) for loss in losses)
        p = float(np.clip(np.exp(-0.5 * weakest) * n_intervals * 60, 1e-300, 1.0))
        return Evidence(
            p, gain, parameters, f"Samples are missing though the time stamps run on: {places}{more}.", "timing", where,
            reweigh=reweigh,
        )  # fmt: skip
