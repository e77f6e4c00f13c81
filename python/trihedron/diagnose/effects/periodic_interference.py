"""A spectral line that motion does not explain."""

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import SENSORS, DirectEffect, Evidence
from trihedron.diagnose.residuals.within_poses import find_lines
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import HeldOut, Where


class PeriodicInterference(DirectEffect):
    """Sinusoids, steady through all poses, each in one or more channels; the strongest first."""

    id = "periodic-interference"
    is_of_samples = True

    def find(self, context: Context) -> Evidence | None:
        # Long poses resolve lines of a hundredth of the noise: such a line is named where it disagrees in its domain
        # and improves the prediction of held-out readings.
        lines = [line for line in find_lines(context.obs) if line.has_size and line.rms_after < line.rms_before]
        if not lines:
            return None
        strongest = min(lines, key=lambda line: line.p_value)
        same = [line for line in lines if abs(line.frequency_hz - strongest.frequency_hz) < line.resolution_hz]
        others = [line for line in lines if line not in same]
        parameters = [EffectParameter("frequency", strongest.frequency_hz, strongest.frequency_sigma_hz, "Hz")]
        for line in (*same, *others):
            of, (sensor, axis) = line.channel, divmod(line.index, 3)
            if line in others:
                parameters.append(EffectParameter(f"frequency_{of}", line.frequency_hz, line.frequency_sigma_hz, "Hz"))
            scale, unit = float(context.si_per_raw(sensor)[axis]), SENSORS[sensor].unit
            size, std = line.amplitude * scale, line.amplitude_sigma * scale
            parameters.append(EffectParameter(f"amplitude_{of}", size, std, unit))
        frequencies = (strongest.frequency_hz, *(line.frequency_hz for line in others))
        where = Where(tuple(line.channel for line in lines), (), (), frequencies)
        before, after, noise = strongest.rms_before, strongest.rms_after, strongest.noise
        held = HeldOut("within-static", (before / noise) ** 2, (after / noise) ** 2, before, after, "raw")
        return Evidence(
            strongest.p_value, float(-2 * np.log(strongest.p_value)), tuple(parameters),
            self.reported(
                "line", frequency_hz=strongest.frequency_hz, channels=[line.channel for line in same],
                has_more=bool(others), others=[(line.frequency_hz, line.channel) for line in others],
            ),
            "within-static", where, (held,), share=min(max(line.share for line in same), 1.0),
        )  # fmt: skip
