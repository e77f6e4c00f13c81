"""The sampling itself as one domain: time errors that both sensors see at once."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy.special import ndtr

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.dropped_samples import DroppedSamples
from trihedron.diagnose.effects.sample_steps import step_errors
from trihedron.diagnose.effects.timing_jitter import FEWEST_SHARP, TimingJitter, common_time_error
from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED
from trihedron.records.domains import DomainTest, Where


def judge_timing(context: Context, alpha: float, refused: Collection[str]) -> DomainTest:
    """Chi-square: squared z of the common time error, plus what lost samples explain; p of the sharper look.

    ``refused`` are ids of effects that did not predict held-out moves any better: jolts look like lost samples.
    """
    step_s = 1.0 / context.obs.recording.rate_hz
    value, spread, n = common_time_error(step_errors(context), step_s)
    if n < FEWEST_SHARP:
        return DomainTest("timing", 1.0, float(n), 1.0, False, rms=0.0, unit="s")
    z = value / spread
    looks = [effect for effect in (DroppedSamples(), TimingJitter()) if effect.id not in refused]
    found = [e for e in (look.find(context) for look in looks) if e is not None]
    p = min([min(1.0, 2.0 * e.p_value) for e in found], default=float(min(1.0, max(2.0 * ndtr(-z), 0.05))))
    where = Where()
    for evidence in found:
        where = Where(where.channels, where.segments + evidence.where.segments, where.times_s + evidence.where.times_s)
    chi2_per_dof = 1.0 + max(z, 0.0) ** 2 / n + sum(e.strength for e in found if e.reweigh is not None) / n
    rms = float(np.sqrt(max(value, 0.0) / 5.0))
    return DomainTest("timing", chi2_per_dof, float(n), p, p < alpha / N_DOMAINS_TESTED, where, rms, "s")
