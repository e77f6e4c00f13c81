"""Sampling instants that scatter about the timestamps."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from trihedron import _core
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.effects.saturation import clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.records.diagnosis import EffectParameter


@lru_cache(maxsize=8)
def common_time_variance(obs: Observations) -> tuple[float, float, int]:
    """Variance of the sampling instants by the times that both sensors see, its standard error (s²), infinite where too
    few samples tell, and their number."""
    if len(obs.whitened) < 2:
        return 0.0, np.inf, 0
    moves = np.array(obs.move_ranges, dtype=np.int64).reshape(-1, 2)
    step_s = 1.0 / obs.recording.rate_hz
    return _core.common_time_variance(obs.time_s, step_s, obs.whitened, clipped_samples(obs), moves)


class TimingJitter(DirectEffect):
    """Time errors of both sensors scatter together, in proportion to the slope of the signal."""

    id = "timing-jitter"
    needs_moves = True

    def find(self, context: Context) -> Evidence | None:
        value, spread, _ = common_time_variance(context.obs)
        if value <= 0.0:
            return None
        z, jitter = value / spread, float(np.sqrt(value))
        return Evidence(
            float(ndtr(-z)), float(z**2),
            (EffectParameter("jitter", jitter, float(0.5 * spread / value * jitter), "s"),),
            self.reported("samples", jitter_s=jitter), "timing", reweigh=lambda obs: replace(obs, jitter_s=jitter),
        )  # fmt: skip
