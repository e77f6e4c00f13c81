"""Samples taken at other instants than their time stamps say, every one by a little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.sample_steps import step_errors
from trihedron.diagnose.observations import Observations
from trihedron.records.diagnosis import EffectParameter


class TimingJitter(DirectEffect):
    """Steps scatter in proportion to the slope of the signal, the same in every channel."""

    id = "timing-jitter"
    mechanism = "samples are taken at other instants than their time stamps say"
    experiment = "let the sensor's own clock trigger the sampling, or log its data-ready times"

    def find(self, context: Context) -> Evidence | None:
        steps = step_errors(context)
        dt = 1.0 / context.obs.recording.rate_hz
        sharp = steps.sigma_s < 0.5 * dt
        if sharp.sum() < 50:
            return None
        ratio = (steps.extra_s[sharp] / steps.sigma_s[sharp]) ** 2
        # One time error in all channels against errors that differ between channels (curvature, noise): the common
        # part must stand out from the misfit left beside it. Medians, so that single losses do not count.
        common = float(np.median(ratio)) / 0.4549
        beside = float(np.median(steps.misfit[sharp])) / 0.87
        excess = common - max(beside, 1.0)
        sigma = 1.7 * np.sqrt(2.0 / sharp.sum()) * max(beside, 1.0) * 1.5
        z = excess / sigma
        if z < 5.0 or common < 1.5 * max(beside, 1.0):
            return None
        # A jitter of σ_t moves a step error by (1.5² + 1.5² + 0.5² + 0.5²) σ_t².
        variance = float(np.median((steps.extra_s[sharp] ** 2) / 0.4549 - max(beside, 1.0) * steps.sigma_s[sharp] ** 2))
        jitter = float(np.sqrt(max(variance, 0.0) / 5.0))
        if jitter < 0.005 * dt:
            return None
        std = jitter / np.sqrt(2.0 * sharp.sum()) * 2.0

        def reweigh(obs: Observations) -> Observations:
            return replace(obs, jitter_s=jitter)

        return Evidence(
            float(max(ndtr(-z), 1e-300)), float(z**2),
            (EffectParameter("jitter", jitter, float(std), "s"),),
            f"Every sample is off its time stamp by about {1e3 * jitter:.2g} ms: steps scatter with the slope of the "
            "signal, alike in all channels.",
            "timing", reweigh=reweigh,
        )  # fmt: skip
