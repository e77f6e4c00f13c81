"""Noise terms and low-pass of a simulated sensor, from the noise measured inside the poses of a recording."""

from collections.abc import Sequence

import numpy as np

from trihedron.channel_facts.low_pass import gain_of
from trihedron.records.pose_noise import PoseNoise
from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.readout import Smoother
from trihedron.simulate.twin_noise import low_pass_like, noise_of_octaves

FEWEST_OCTAVES = 4
N_FREQUENCIES = 256
"""Number of evenly spaced frequencies up to half the rate at which a filter's gain is compared."""


def noise_from_poses(axes: Sequence[PoseNoise]) -> tuple[NoiseTerms, Smoother] | None:
    """Noise terms and low-pass of a sensor, fitted to the octaves of a typical pose; None where they are too few."""
    # Octaves common to all axes, below half the rate.
    rate = axes[0].rate_hz
    by_axis = [{o.low_hz: o.density for o in axis.octaves} for axis in axes]
    bands = [o for o in axes[0].octaves if all(o.low_hz in one for one in by_axis)]
    bands = [o for o in bands if o.high_hz <= 0.5 * rate]
    if len(bands) < FEWEST_OCTAVES:
        return None
    rounding = np.array([axis.step**2 / (12.0 * rate) for axis in axes])
    density = np.array([[one[o.low_hz].value for one in by_axis] for o in bands])
    return noise_of_octaves(
        np.array([(o.low_hz, o.high_hz) for o in bands]),
        np.maximum(density - rounding, 1e-3 * density),
        np.array([[one[o.low_hz].sigma_log for one in by_axis] for o in bands]),
        1.0 / rate,
        _low_pass(axes),
        _white(axes),
    )


def _low_pass(axes: Sequence[PoseNoise]) -> Smoother | None:
    """The low-pass whose gain is nearest to the filter detected on all axes; an empty one where none is detected.

    Axes with different corners contain motion of the hand or the support: then ``None``, and the octaves decide.
    """
    rate = axes[0].rate_hz
    seen = [(one.corner_hz.value, one.corner_shape) for one in axes if one.corner_hz is not None]
    if not seen:
        return Smoother()
    if len(seen) < len(axes) or len(set(seen)) > 1:
        return None
    frequency_hz = rate * (np.arange(N_FREQUENCIES) + 0.5) / (2 * N_FREQUENCIES)
    return low_pass_like(frequency_hz, gain_of(frequency_hz, *seen[0], rate), 1.0 / rate)


def _white(axes: Sequence[PoseNoise]) -> list[tuple[float, float] | None]:
    """N of every axis with its relative error, where all axes show one filter or none.

    Where the corners differ, the noise below them includes motion.
    """
    if len({(one.corner_hz, one.corner_shape) for one in axes}) > 1:
        return [None] * len(axes)
    return [None if one.white is None else (one.white.value, one.white.sigma_log) for one in axes]
