"""Noise of a sensor that is larger, or smaller, for a while."""

import numpy as np

from trihedron.arrays import AXES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import SENSORS, DirectEffect, Evidence
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS
from trihedron.diagnose.residuals.noise_level import noise_changes
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where


class NonstationaryNoise(DirectEffect):
    """The noise of one sensor has another level in consecutive poses.

    The errors of pose means and of moves follow from the noise of each: the fit needs no correction.
    """

    id = "nonstationary-noise"
    is_of_samples = True
    of_session = None

    def find(self, context: Context) -> Evidence | None:
        changes = noise_changes(context.obs)
        if not changes:
            return None
        obs, parameters, said = context.obs, [], []
        clearest = max(changes, key=lambda one: one.score)
        same = [one for one in changes if one.score >= 0.5 * clearest.score]
        poses, t = obs.segments.poses, obs.time_s
        spans = [(float(t[poses[one.first].start]), float(t[poses[one.last].stop - 1])) for one in same]
        for one, span in zip(same, spans, strict=True):
            label, prefix, _ = SENSORS[one.sensor]
            parameters += [
                EffectParameter(f"noise_ratio_{CHANNELS[3 * one.sensor + axis]}", float(ratio), float(sigma), "1")
                for axis, ratio, sigma in zip(one.axes, one.ratio, one.sigma, strict=True)
            ]
            parameters += [
                EffectParameter(f"{prefix}_{name}", at, 0.0, "s") for name, at in zip(("from", "to"), span, strict=True)
            ]
            axes = [AXES[one.axes[k]] for k in one.changed]
            said.append((label, one.ratio[one.changed].tolist(), axes, *span))
        channels = tuple(channel for one in same for channel in one.channels)
        named = [pose for one in same for pose in range(one.first, one.last + 1)]
        return Evidence(
            float(np.exp(-0.5 * clearest.score)), clearest.score, tuple(parameters),
            self.reported("changes", changes=said), "within-static",
            Where(channels, obs.pose_names(named), tuple(spans)), share=max(one.share for one in same),
        )  # fmt: skip
