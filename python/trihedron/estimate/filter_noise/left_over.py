"""Error over a horizon of a filter that does not correct S and g-sensitivity, drawn from their posterior."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.strengths import DRAWN, Fitted
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.estimate.reference.motion import MotionFit
from trihedron.records import Recording
from trihedron.records.filter_noise import Cause
from trihedron.session.drift import LEAST_SWING_K

Left = dict[float, dict[Cause, FloatArray]]
"""Mean squares (k,) [rad²] by horizon and cause."""
SIZES = np.append(0.0, np.geomspace(1e-5, 0.1, 33))
"""Sizes tried for the error of the elements of S; without 0 the draws of an error that noise explains would exclude 0,
as squares add up."""
G_SENSITIVITY = "gyro-g-sensitivity"
PARTS = np.append(0.0, np.geomspace(1e-2, 10.0, 33))
"""Sizes tried for the g-sensitivity, in units of the data sheets' typical value."""
FLAT = 1e-2
"""Fraction of the prior's information that stays when a prior is removed, so that none is negative."""


def left_over(found: MotionFit, horizons_s: Sequence[float]) -> Left:
    """Mean square errors over all starts of every horizon of a gyro with one scale, orthogonal axes, no g-sensitivity.

    The mounting is no calibration error, and a filter estimates the bias: neither is included.
    """
    side, point = found.sides[0], found.points[0]
    grid = side.grid
    C = side.reference.attitude(grid.time_s * (1.0 + point.rate) + point.offset_s) @ point.mounting

    def carried(signal: FloatArray) -> FloatArray:
        """(n, 3, 9) derivative of the angle by the elements of a matrix times a signal (n, 3) less its mean."""
        apart = np.where(side.seen[:, None], signal - signal[side.seen].mean(axis=0), 0.0)
        return np.cumsum(np.einsum("nij,nk->nijk", C, apart).reshape(len(C), 3, 9), axis=0) * grid.step_s

    S = found.value(0, "S").reshape(3, 3)
    u, scales, vt = np.linalg.svd(S)
    # For counts the mean scale is nominal and no error; for readings in SI the scale is 1.
    scale = 1.0 if 0.5 < float(np.mean(scales)) < 2.0 else float(np.mean(scales))
    # A rotation of the mounting times a symmetric matrix, of six elements.
    every = np.eye(9).reshape(9, 3, 3)
    kept = np.linalg.svd((u @ vt @ (every + every.swapaxes(1, 2))).reshape(9, 9))[2][:6]
    known = np.asarray(np.linalg.inv(kept @ found.covariance(0, ("S",)) @ kept.T), dtype=np.float64)
    elements = drawn_errors(known, known @ kept @ (S - scale * u @ vt).ravel(), SIZES) @ kept
    by: dict[Cause, tuple[FloatArray, FloatArray]] = {"calibration": (carried(grid.gyroscope), elements)}
    if side.force is not None and G_SENSITIVITY in found.places[0]:
        by["g-sensitivity"] = (carried(side.force), _g_sensitivities(found))
    ahead = {h: max(1, round(h / grid.step_s)) for h in horizons_s}
    return {
        h: {cause: mean_square(angle[n:] - angle[:-n], errors) for cause, (angle, errors) in by.items()}
        for h, n in ahead.items()
    }


def _g_sensitivities(found: MotionFit) -> FloatArray:
    """(k, 9) draws of the g-sensitivity: its likelihood without the fit's prior, with one size for all elements."""
    name = G_SENSITIVITY
    size = float(np.mean(found.sides[0].sigma(name, found.wider)))
    known = np.asarray(np.linalg.inv(found.covariance(0, (name,))), dtype=np.float64)
    return drawn_errors(known - (1.0 - FLAT) * np.eye(len(known)) / size**2, known @ found.value(0, name), size * PARTS)


def mean_square(steps: FloatArray, errors: FloatArray) -> FloatArray:
    """(k,) mean square error of parameter errors (k, f), from their derivatives (n, 3, f) at n starts."""
    square = np.einsum("nai,naj->ij", steps, steps) / max(1, len(steps))
    return np.asarray(np.einsum("ki,ij,kj->k", errors, square, errors))


def drawn_errors(information: FloatArray, moment: FloatArray, sizes: FloatArray) -> FloatArray:
    """(k, f) posterior draws of errors under the information (f, f) and moment (f,) of their likelihood and one prior σ
    among ``sizes``.

    Without the prior the variance of the estimate would count twice: noise makes a perfect matrix seem imperfect.
    """
    width = [np.eye(len(moment)) + size**2 * information for size in sizes]
    gain = np.array([size**2 * moment @ np.linalg.solve(V, moment) for size, V in zip(sizes, width, strict=True)])
    log_p = 0.5 * (gain - np.linalg.slogdet(width)[1])
    weight, rng = np.exp(log_p - log_p.max()), np.random.default_rng(0)
    chosen = rng.choice(sizes, DRAWN, p=weight / weight.sum())
    return np.array([_drawn_under(size, information, moment, rng) for size in chosen])


def _drawn_under(size: float, information: FloatArray, moment: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(f,) a draw of coefficients under the information and moment of their likelihood and a prior σ."""
    cov = size**2 * np.linalg.inv(np.eye(len(moment)) + size**2 * information)
    values, vectors = np.linalg.eigh(0.5 * (cov + cov.T))
    return np.asarray(cov @ moment + vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(moment))))


# Bias proportional to a logged temperature: its effect on a stretch, and its share of the error.


OF_BLOCK = (np.arange(200) + 0.5) / 200 - 0.5
"""Parts of a block over which the temperature is averaged."""
GROUPS = 40
"""Groups of draws with similar K: the coefficients of a group use the strengths of its median draw."""


def beside_temperature(stretches: Sequence[Stretch], recording: Recording) -> list[Stretch]:
    """Stretches with a bias proportional to the logged temperature; unchanged where none was logged or its range is
    below ``LEAST_SWING_K``."""
    degrees = recording.temperature_degc
    if degrees is None or np.count_nonzero(is_there := np.isfinite(degrees)) < 2:
        return list(stretches)
    time, value = recording.time_s[is_there], degrees[is_there]
    # Block means reduce the thermometer's noise and resolution.
    within = [one.time_s[:, None] + one.step_s * OF_BLOCK for one in stretches]
    means = [np.interp(at, time, value).mean(axis=1) for at in within]
    every = np.concatenate(means)
    if np.ptp(every) < LEAST_SWING_K:
        return list(stretches)
    return [replace(one, kelvin=kelvin - every.mean()) for one, kelvin in zip(stretches, means, strict=True)]


def of_temperature(stretches: Sequence[Stretch], found: Fitted, horizons_s: Sequence[float]) -> Left:
    """Mean square errors, over all starts of every horizon, from the change of bias with temperature since the start;
    empty where no temperature was logged."""
    if stretches[0].kelvin is None:
        return {}
    errors = _drawn(stretches, found)
    of_all = {h: np.concatenate([_since_start(one, h) for one in stretches]) for h in horizons_s}
    return {h: {"temperature": mean_square(steps, errors)} for h, steps in of_all.items()}


def _drawn(stretches: Sequence[Stretch], found: Fitted) -> FloatArray:
    """(k, 3) bias per kelvin [SI/K], one for each draw of the strengths.

    A slow bias change is due to temperature or to the random walk: each coefficient is drawn under a K near its draw's.
    """
    size = found.draws[:, NAMES.index("per_kelvin")]
    order = np.argsort(found.draws[:, NAMES.index("bias_walk")])
    rng = np.random.default_rng(0)
    errors = np.empty((len(order), 3))
    for some in np.array_split(order, GROUPS):
        others = np.where(np.isin(NAMES, "per_kelvin"), 0.0, found.draws[some[len(some) // 2]])
        information, moment = np.zeros((3, 3)), np.zeros(3)
        # All stretches are of one sensor.
        for one in stretches:
            assert one.warmth is not None
            L, w = one.factor(others)
            half = solve_triangular(L, one.warmth, lower=True, check_finite=False)
            information += half.T @ half
            moment += half.T @ w
        for k in some:
            errors[k] = _drawn_under(size[k], information, moment, rng)
    return errors


def _since_start(stretch: Stretch, horizon_s: float) -> FloatArray:
    """(n, 3, 3) derivative, by the bias per kelvin, of the error over a horizon from each of n starts."""
    assert stretch.kelvin is not None
    m = len(stretch.time_s)
    ahead = max(1, round(horizon_s / stretch.step_s))
    own = stretch.bias_steps.reshape(m, 3, m, 3)[-1].transpose(1, 0, 2)[:-1]
    zero = np.zeros((1, 3, 3))
    plain, warm = (
        np.concatenate([zero, np.cumsum(own * by[:, None, None], axis=0)])
        for by in (np.ones(m - 1), stretch.kelvin[:-1])
    )
    edge = np.append(stretch.kelvin[:1], 0.5 * (stretch.kelvin[1:-1] + stretch.kelvin[:-2]))[: max(m - ahead, 0)]
    n = len(edge)
    return np.asarray(warm[ahead : ahead + n] - warm[:n] - edge[:, None, None] * (plain[ahead : ahead + n] - plain[:n]))
