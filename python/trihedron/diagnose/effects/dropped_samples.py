"""Samples lost without a trace in the time stamps."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.sample_steps import step_errors
from trihedron.diagnose.twin import Distortion
from trihedron.records.diagnosis import EffectParameter, Where

MIN_LOST = 0.6
"""A loss is a whole number of samples; below this it is jitter."""


class DroppedSamples(DirectEffect):
    """Every channel jumps at once by the same missing time, a whole number of samples."""

    id = "dropped-samples"
    mechanism = "samples are missing though the time stamps run on evenly"
    experiment = "log the sensor's own sample counter"

    def find(self, context: Context) -> Evidence | None:
        steps = step_errors(context)
        if len(steps.sample) == 0:
            return None
        dt = 1.0 / context.obs.recording.rate_hz
        lost = steps.extra_s / dt
        # Judged against the scatter of all steps: quick motion and jitter widen it.
        scatter = 1.4826 * np.median(np.abs(steps.extra_s / steps.sigma_s))
        z = steps.extra_s / steps.sigma_s / max(float(scatter), 1.0)
        p = np.minimum(1.0, chdtrc(1, z**2) * len(z))
        ordinary = np.quantile(np.abs(lost[steps.sigma_s < 0.3 * dt]), 0.9) if (steps.sigma_s < 0.3 * dt).any() else 1.0
        hit = (p < 1e-6) & (lost > max(MIN_LOST, 4.0 * ordinary)) & (steps.misfit < 0.15 * steps.gain + 4.0)
        if not hit.any():
            return None
        # A jump shows in neighbouring intervals too: keep the strongest within five samples.
        order = [k for k in np.argsort(-steps.gain) if hit[k]]
        chosen: list[int] = []
        for k in order:
            if all(abs(steps.sample[k] - steps.sample[j]) > 5 for j in chosen):
                chosen.append(int(k))
        chosen.sort(key=lambda k: int(steps.sample[k]))
        if len(chosen) > 0.02 * len(z):
            return None  # everywhere is not a loss here and there: see timing-jitter
        obs = context.obs
        columns_rate = np.zeros((context.n_points, 3, len(chosen)))
        columns_force = np.zeros((context.n_points, 3, len(chosen)))
        for c, k in enumerate(chosen):
            m = int(steps.move[k])
            where = context.moves[m]
            row = where.start + int(steps.sample[k]) - obs.move_ranges[m][0]
            for r in (row, row + 1):
                # One lost sample is one more interval at the local rate; half of it goes to either side.
                columns_rate[r, :, c] = -0.5 * context.rate[r]
                columns_force[r, :, c] = -0.5 * (context.force[r] - context.gravity_in_moves[r])
        names = tuple(f"lost_at_{float(obs.time_s[steps.sample[k]]):.2f}s" for k in chosen)
        variant = Variant(Distortion(columns_force, columns_rate), names, ("samples",) * len(names))
        total = float(lost[chosen].sum())
        std = float(np.sqrt((np.maximum(steps.sigma_s[chosen] / dt, 0.1) ** 2).sum()))
        parameters = (
            EffectParameter("events", float(len(chosen)), 0.0, "1"),
            EffectParameter("samples_lost", total, std, "1"),
            *(
                EffectParameter(name, float(lost[k]), float(max(steps.sigma_s[k] / dt, 0.1)), "samples")
                for name, k in zip(names, chosen, strict=True)
            ),
        )
        places = ", ".join(f"{lost[k]:.0f} at {obs.time_s[steps.sample[k]]:.2f} s" for k in chosen[:4])
        t = tuple((float(obs.time_s[steps.sample[k]]), float(obs.time_s[steps.sample[k] + 1])) for k in chosen)
        segments = tuple(dict.fromkeys(f"move {int(steps.move[k])}" for k in chosen))
        return Evidence(
            float(max(p[chosen].min(), 1e-300)), float(steps.gain[chosen].sum()), parameters,
            f"Samples are missing though the time stamps run on: {places}.", "timing", Where((), segments, t),
            variant=variant,
        )  # fmt: skip
