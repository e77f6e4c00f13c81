"""Noise in the poses of a recording, for its digital twin: N, B and the low-pass that filters them."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from trihedron.arrays import FloatArray
from trihedron.channel_facts.low_pass import gain_of
from trihedron.records.pose_noise import PoseNoise
from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.readout import Smoother, triple

_FREQUENCIES = np.pi * (np.arange(1 << 13) + 0.5) / (1 << 13)
# Corner frequencies, as fractions of the sampling rate, and orders that are tried.
_CORNERS = (0.03, 0.045, 0.06, 0.08, 0.1, 0.12, 0.15, 0.19, 0.24, 0.3, 0.37, 0.45)
_ORDERS = (1, 2, 3, 4, 6)

FILTER_EARNS = 16.0
"""Smallest gain in twice the log-likelihood for a low-pass over none; the same as where a corner is measured."""
FLICKER_EARNS = 6.63
"""Smallest gain in twice the log-likelihood for flicker over none: the 1 % point of χ² with one degree of freedom."""
HIDDEN = 1e-2
"""Power gain below which the ADC's rounding and spectral leakage hide the shape of a filter."""
LOWEST, HIGHEST = 5e-3, 2.0
"""Corner frequencies searched, as fractions of the sampling rate: 1/100 to 4 times the Nyquist frequency."""
SHAPES = 0.1
"""Relative model error of a density: lines and sharper filters are not represented by two terms and a low-pass."""


FEWEST_BELOW = 4
"""Number of octaves starting below the corner from which on only these are fitted for N and B."""


def noise_of_octaves(
    bands_hz: FloatArray,
    density: FloatArray,
    relative: FloatArray,
    dt: float,
    low_pass: Smoother | None = None,
    white: Sequence[tuple[float, float] | None] = (None, None, None),
) -> tuple[NoiseTerms, Smoother]:
    """Terms per axis and the low-pass that all axes share, from mean densities in frequency bands.

    ``bands_hz`` (m, 2), ``density`` (m, 3) two-sided, unit²/Hz (that of white noise is N²), ``relative`` (m, 3) their
    relative standard errors. ``low_pass``: the one detected, its corner 0 where there is none; or None, and a filter
    must gain ``FILTER_EARNS`` over none, because one fits any coloured noise. ``white``: N of each axis and its
    relative error where measured below a low-pass; it adds a density of N.
    """
    frequency_hz = _FREQUENCIES / (2.0 * np.pi * dt)
    inside = [(low <= frequency_hz) & (frequency_hz < high) for low, high in bands_hz]

    def fitted(low_pass: Smoother, bands: slice = slice(None)) -> tuple[list[FloatArray], float]:
        power = _power(low_pass, dt)
        # Both terms pass through the low-pass, as in the simulated sensor.
        flicker = power / (2.0 * np.pi * frequency_hz)
        design = np.array([[float(column[one].mean()) for column in (power, flicker)] for one in inside])
        terms, misfit = [], 0.0
        for k, known in enumerate(white):
            rows, seen, error = design[bands], density[bands, k], relative[bands, k]
            if known is not None:
                rows = np.vstack([rows, [1.0, 0.0]])
                seen, error = np.append(seen, known[0] ** 2), np.append(error, 2.0 * known[1])
            variances, own = _earned(rows, seen, error)
            terms.append(np.sqrt(variances))
            misfit += own
        return terms, misfit

    if low_pass is None or low_pass.corner_hz > 0.0:
        # The detected filter and those tried: where noisy poses determined its corner, a typical one has another.
        filters = [Smoother(), *(Smoother(part / dt, order) for order in _ORDERS for part in _CORNERS)]
        filters += [] if low_pass is None else [low_pass]
        misfits = [fitted(one)[1] for one in filters]
        best = int(np.argmin(misfits))
        low_pass = filters[best if low_pass is not None or misfits[0] - misfits[best] > FILTER_EARNS else 0]
    # Above the corner rounding and the filter's shape dominate: no octave there separates white noise from flicker.
    n_below = int(np.count_nonzero(bands_hz[:, 0] < low_pass.corner_hz))
    below = slice(n_below if low_pass.corner_hz > 0.0 and n_below >= FEWEST_BELOW else None)
    N, B = (triple(column) for column in np.array(fitted(low_pass, below)[0]).T)
    return NoiseTerms(N=N, B=B), low_pass


def low_pass_like(frequency_hz: FloatArray, gain: FloatArray, dt: float) -> Smoother:
    """The low-pass whose power gain is nearest to ``gain`` (m,) at ``frequency_hz`` (m,) in mean square of ln(gain).

    Gains below ``HIDDEN`` are set to ``HIDDEN``.
    """
    wanted = np.log(np.maximum(gain, HIDDEN))

    def misfit(log_corner: float, order: int) -> float:
        made = _power(Smoother(float(np.exp(log_corner)), order), dt, 2.0 * np.pi * frequency_hz * dt)
        return float(np.mean((np.log(np.maximum(made, HIDDEN)) - wanted) ** 2))

    tried = np.log(np.geomspace(LOWEST / dt, HIGHEST / dt, 40))
    found = []
    for order in _ORDERS:
        start = int(np.argmin([misfit(one, order) for one in tried]))
        bounds = tried[max(start - 1, 0)], tried[min(start + 1, len(tried) - 1)]
        best = minimize_scalar(misfit, args=(order,), bounds=bounds, method="bounded")
        found.append((float(best.fun), order, float(np.exp(best.x))))
    _, order, corner_hz = min(found)
    return Smoother(corner_hz, order)


def _earned(design: FloatArray, density: FloatArray, relative: FloatArray) -> tuple[FloatArray, float]:
    """Variances of white noise and of flicker (0 where it gains less than ``FLICKER_EARNS``), and -2 log-likelihood."""
    spread, most = np.hypot(relative, SHAPES), float(density.max())
    white, alone = _non_negative(design[:, :1], density, spread, (1e-3 * most, 1e-6 * most))
    both, misfit = _non_negative(design, density, spread, (1e-3 * most, 1e-6 * most))
    return (both, misfit) if alone - misfit > FLICKER_EARNS else (np.append(white, 0.0), alone)


def _non_negative(
    design: FloatArray, seen: FloatArray, relative: FloatArray, least: tuple[FloatArray | float, FloatArray | float]
) -> tuple[FloatArray, float]:
    """Non-negative weights of the columns, errors ``relative`` to the model, and -2 log-likelihood; the model is at
    least ``least``, at first and later."""
    model = np.maximum(seen, least[0])
    solution, misfit = np.zeros(design.shape[1]), 0.0
    for _ in range(5):
        scaled = design / (model * relative)[:, None]
        norms = np.linalg.norm(scaled, axis=0)
        found, misfit = nnls(scaled / norms, seen / (model * relative))
        solution = found / norms
        model = np.maximum(design @ solution, least[1])
    return solution, float(misfit) ** 2 + 2.0 * float(np.sum(np.log(model)))


def _power(low_pass: Smoother, dt: float, turns: FloatArray = _FREQUENCIES) -> FloatArray:
    """(m,) power gain of the low-pass at ``turns`` (m,) [rad/sample]."""
    if low_pass.corner_hz == 0.0:
        return np.ones(len(turns))
    a = low_pass.feedback(dt)
    return np.asarray(np.abs(a.sum() / np.polyval(a[::-1], np.exp(-1j * turns))) ** 2)


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
