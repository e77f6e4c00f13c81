"""Linear-Gaussian inference on the whitened rows: fit, marginal likelihood, score tests, held-out prediction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, cholesky, eigh, solve_triangular

from trihedron.diagnose.session.observations import FloatArray, Observations
from trihedron.diagnose.session.twin import (
    DYNAMICS,
    MOVES,
    STATIC_ACCEL,
    STATIC_GYRO,
    Distortion,
    Linearisation,
    Prior,
    System,
    Twin,
    stacked,
)

N_DOMAINS = 4
"""Domains of residual rows: the first four labels."""
RELATIVE_RIDGE = 1e-12
"""Added to the diagonal of the scaled normal matrix: directions the recording does not see stay finite."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A twin at its optimum on some rows: the state, the linearisation there and the normal equations.

    ``n_effect`` columns at the end of ``jacobian`` belong to effects. ``covariance`` of all unknowns.
    """

    twin: Twin
    line: Linearisation
    system: System
    jacobian: FloatArray
    scale: FloatArray
    chi2: float
    log_marginal: float

    @property
    def n_effect(self) -> int:
        """Number of effect parameters in the fit."""
        return self.line.distortion.n_parameters

    def covariance(self) -> FloatArray:
        """(unknowns, unknowns) covariance at the optimum."""
        scaled = self.jacobian / self.scale
        normal = scaled.T @ scaled
        normal[np.diag_indices_from(normal)] += RELATIVE_RIDGE
        inverse = np.linalg.inv(normal)
        cov: FloatArray = inverse / np.outer(self.scale, self.scale)
        return cov


def _scaled(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    scale = np.sqrt((jacobian**2).sum(axis=0))
    scale[scale == 0] = 1.0
    return jacobian / scale, scale


def _with_effects(line: Linearisation) -> tuple[System, FloatArray]:
    system = line.system()
    jacobian = system.jacobian
    if line.distortion.n_parameters:
        jacobian = np.hstack([jacobian, line.columns(line.distortion)])
    return system, jacobian


def fit(
    obs: Observations, start: Twin, distortion: Distortion, prior: Prior | None = None, n_iterations: int = 4
) -> Fit:
    """Gauss-Newton on every row, damped where a full step would not help (eq. 8.5).

    The model is close to linear, so a few full steps converge; a move whose readings are false, or a start that is far
    off, may throw them: a step that raises the misfit is taken back and tried shorter (Levenberg-Marquardt).
    """
    twin = start
    if len(twin.effect) != distortion.n_parameters:
        twin = replace(twin, effect=np.zeros(distortion.n_parameters))
    return _fit_of(_descend(_State.at(obs, twin, distortion, prior), n_iterations))


def _descend(state: _State, n_iterations: int) -> _State:
    line = state.line
    damping = 0.0
    for _ in range(n_iterations):
        scaled = state.jacobian / state.scale
        for _ in range(MAX_RETRIES):
            normal = state.normal.copy()
            normal[np.diag_indices_from(normal)] += RELATIVE_RIDGE + damping
            step = -cho_solve(cho_factor(normal), scaled.T @ state.system.residual)
            try:
                tried = _State.at(line.obs, state.twin.advanced(step / state.scale), line.distortion, line.prior)
            except np.linalg.LinAlgError:  # so long a step that a triad collapsed: no noise can be carried through it
                damping = max(10.0 * damping, MIN_DAMPING)
                continue
            if tried.chi2 <= state.chi2 * (1.0 + MAY_RISE) + 1.0:
                damping = 0.0 if damping < MIN_DAMPING else 0.1 * damping
                break
            damping = max(10.0 * damping, MIN_DAMPING)
        else:
            break
        moved = float(np.linalg.norm(scaled @ step))
        state = tried
        if moved < 1e-3:  # the whitened rows move by less than a thousandth of sigma
            break
    return state


def _fit_of(state: _State) -> Fit:
    log_det = 2.0 * float(np.log(np.diag(cholesky(state.regular()))).sum()) + 2.0 * float(np.log(state.scale).sum())
    return Fit(
        state.twin, state.line, state.system, state.jacobian, state.scale, state.chi2,
        -0.5 * state.chi2 - 0.5 * log_det + state.system.log_weight,
    )  # fmt: skip


MAX_RETRIES = 8
MIN_DAMPING = 1e-4
MAY_RISE = 1e-3
"""Noise follows the scale by a little, so that a good step may raise the misfit by this share."""


@dataclass(frozen=True, eq=False)
class _State:
    """One linearisation with its normal equations, columns scaled to unit length."""

    twin: Twin
    line: Linearisation
    system: System
    jacobian: FloatArray
    scale: FloatArray
    normal: FloatArray
    chi2: float

    @staticmethod
    def at(obs: Observations, twin: Twin, distortion: Distortion, prior: Prior | None) -> _State:
        line = Linearisation(obs, twin, distortion, prior)
        return _State.of(twin, line, *_with_effects(line))

    @staticmethod
    def of(twin: Twin, line: Linearisation, system: System, jacobian: FloatArray) -> _State:
        scaled, scale = _scaled(jacobian)
        chi2 = float(system.residual @ system.residual)
        return _State(twin, line, system, jacobian, scale, scaled.T @ scaled, chi2 if np.isfinite(chi2) else np.inf)

    def with_corners(self, accel_corner_s: float, gyro_corner_s: float) -> _State:
        """The same point with other noise corners: only the rows of the walks change, in proportion."""
        factors = np.array([1.0, accel_corner_s / self.twin.accel_corner_s, gyro_corner_s / self.twin.gyro_corner_s])
        if (factors == 1.0).all():
            return self
        row = factors[self.system.walk.clip(0, 2)]
        row[self.system.walk > 2] = 1.0
        jacobian = self.jacobian * row[:, None]
        n = self.system.jacobian.shape[1]
        system = replace(
            self.system,
            residual=self.system.residual * row,
            jacobian=jacobian[:, :n],
            log_weight=self.system.log_weight + float(np.log(row).sum()),
        )
        twin = replace(self.twin, accel_corner_s=accel_corner_s, gyro_corner_s=gyro_corner_s)
        return _State.of(twin, self.line.at_twin(twin, self.line.distortion), system, jacobian)

    def regular(self) -> FloatArray:
        out = self.normal.copy()
        out[np.diag_indices_from(out)] += RELATIVE_RIDGE
        return out


def leverage(fitted: Fit) -> FloatArray:
    """(rows,) share of every row that the fit used up; degrees of freedom of a block are the sum of one minus it."""
    scaled = fitted.jacobian / fitted.scale
    normal = scaled.T @ scaled
    normal[np.diag_indices_from(normal)] += RELATIVE_RIDGE
    half = solve_triangular(cholesky(normal, lower=True), scaled.T, lower=True)
    out: FloatArray = (half**2).sum(axis=0)
    return out


@dataclass(frozen=True, eq=False)
class Reduced:
    """The rows of a fit with its unknowns projected out, ready to score many candidates cheaply."""

    fitted: Fit
    factor: FloatArray
    scaled: FloatArray

    def project(self, columns: FloatArray) -> FloatArray:
        """Columns minus what the unknowns of the fit can imitate."""
        return columns - self.scaled @ cho_solve((self.factor, True), self.scaled.T @ columns)


def reduce(fitted: Fit) -> Reduced:
    """Factor the normal equations of a fit once."""
    scaled = fitted.jacobian / fitted.scale
    normal = scaled.T @ scaled
    normal[np.diag_indices_from(normal)] += RELATIVE_RIDGE
    return Reduced(fitted, np.asarray(cholesky(normal, lower=True)), scaled)


@dataclass(frozen=True, eq=False)
class Score:
    """Score test of added columns: ``chi2`` gained, ``rank`` directions seen, the one-step estimate, its covariance."""

    chi2: float
    rank: int
    estimate: FloatArray
    covariance: FloatArray
    visible: npt.NDArray[np.bool_]


def score(reduced: Reduced, columns: FloatArray) -> Score:
    """Rao's score test of effect columns against the fitted twin (eq. 8.7).

    Directions whose projection keeps less than 1e-6 of their length are imitated by the calibration itself and are not
    counted: they cannot be seen in this recording.
    """
    residual = reduced.fitted.system.residual
    projected = reduced.project(columns)
    length = np.sqrt((columns**2).sum(axis=0))
    length[length == 0] = 1.0
    normal = (projected / length).T @ (projected / length)
    gradient = (projected / length).T @ residual
    value, vector = eigh(normal)
    seen = value > 1e-6
    along = vector[:, seen].T @ gradient
    chi2 = float((along**2 / value[seen]).sum())
    inverse = (vector[:, seen] / value[seen]) @ vector[:, seen].T
    visible = np.diag(normal) > 1e-6
    return Score(chi2, int(seen.sum()), -(inverse @ gradient) / length, inverse / np.outer(length, length), visible)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Held-out prediction of rows: innovation chi-square per fold and domain, its volume, and the innovations.

    ``fold_chi2`` (folds, domains), ``fold_log_det`` (folds,) log-determinant of the predicted covariance, ``n_rows``
    (domains,), ``residual`` (rows,) whitened innovations; ``innovation`` (rows,) the same over each row's own noise
    alone, so that a model which merely predicts less sharply does not look better in physical units.
    """

    fold_chi2: FloatArray
    fold_log_det: FloatArray
    n_rows: FloatArray
    residual: FloatArray
    innovation: FloatArray

    @property
    def chi2(self) -> FloatArray:
        """(domains,) innovation chi-square."""
        out: FloatArray = self.fold_chi2.sum(axis=0)
        return out

    @property
    def per_row(self) -> FloatArray:
        """(domains,) innovation chi-square per row."""
        out: FloatArray = self.chi2 / np.maximum(self.n_rows, 1e-9)
        return out


def held_out_gain(before: Prediction, after: Prediction) -> FloatArray:
    """(folds,) gain in log predictive density, each domain's chi-square over what remains in it (eq. 8.9).

    Noise that is larger than predicted makes every difference of chi-square larger too; divided by the dispersion that
    stays after the effect (at least 1), a gain counts as it would in a recording without the unexplained rest.
    """
    stays = np.maximum(after.per_row, 1.0)
    gain: FloatArray = 0.5 * ((before.fold_chi2 - after.fold_chi2) / stays).sum(axis=1)
    return gain + 0.5 * (before.fold_log_det - after.fold_log_det)


def folds_of(fitted: Fit, n_folds: int = 8) -> list[npt.NDArray[np.bool_]]:
    """Blocks of neighbouring poses, then of neighbouring moves, whose rows are held out together."""
    system, obs = fitted.system, fitted.line.obs
    direct = system.walk == 0
    out = []
    for labels, count in (((STATIC_ACCEL, STATIC_GYRO), obs.n_holds), ((MOVES, DYNAMICS), obs.n_moves)):
        for block in np.array_split(np.arange(count), min(n_folds, max(count // 2, 1))):
            held = np.isin(system.domain, labels) & direct & np.isin(system.segment, block)
            if held.any():
                out.append(held)
    return out


def predict_held_out(fitted: Fit, folds: list[npt.NDArray[np.bool_]], n_domains: int = N_DOMAINS) -> Prediction:
    """Predict every fold's rows from the others (blocked cross-validation, eq. 8.8).

    The held-out hold's own vertical and biases are unknown to the training rows; a weak prior (its column scale) keeps
    them proper, and it is the same for every model that is compared.
    """
    residual = fitted.system.residual
    scaled = fitted.jacobian / fitted.scale
    # The state at the optimum of all rows: the training optimum is one linear step away.
    normal = scaled.T @ scaled
    ridge = 1e-6
    chi2 = np.zeros((len(folds), n_domains))
    log_det = np.zeros(len(folds))
    count = np.zeros(n_domains)
    out, plain = np.zeros_like(residual), np.zeros_like(residual)
    for fold, held in enumerate(folds):
        rows = scaled[held]
        train = normal - rows.T @ rows
        train[np.diag_indices_from(train)] += ridge
        gradient = scaled[~held].T @ residual[~held]
        factor = cho_factor(train)
        innovation = residual[held] - rows @ cho_solve(factor, gradient)
        spread = rows @ cho_solve(factor, rows.T)
        spread[np.diag_indices_from(spread)] += 1.0
        # Directions the training rows leave open (the held-out vertical) carry no information: keep the others.
        value, vector = eigh(spread)
        along = vector.T @ innovation
        known = value < 1e4
        log_det[fold] = float(np.log(value[known]).sum())
        whitened = vector[:, known] @ (along[known] / np.sqrt(value[known]))
        share = (vector[:, known] ** 2).sum(axis=1)
        out[held] = whitened
        plain[held] = vector[:, known] @ along[known]
        domain = fitted.system.domain[held]
        for d in range(n_domains):
            chi2[fold, d] = float((whitened[domain == d] ** 2).sum())
            count[d] += float(share[domain == d].sum())
    return Prediction(chi2, log_det, count, out, plain)


def tune_noise(
    obs: Observations, start: Twin, distortion: Distortion, prior: Prior | None, n_iterations: int = 4
) -> Fit:
    """Choose the two corner times by marginal likelihood on a grid (eq. 8.6).

    Only the rows of the two walks depend on a corner time, each in proportion to it: the linear optimum and its
    evidence follow from the rows already made, without running the motion again.
    """
    if len(start.effect) != distortion.n_parameters:
        start = replace(start, effect=np.zeros(distortion.n_parameters))
    return _tuned(_State.at(obs, start, distortion, prior), n_iterations)


def extend(base: Fit, accepted: Distortion, added: Distortion, n_iterations: int = 2) -> Fit:
    """The fit with further effect columns, from where it stands: the motion there is known already."""
    both = stacked([accepted, added])
    twin = replace(base.twin, effect=np.concatenate([base.twin.effect, np.zeros(added.n_parameters)]))
    jacobian = np.hstack([base.jacobian, base.line.columns(added)])
    return _tuned(_State.of(twin, base.line.at_twin(twin, both), base.system, jacobian), n_iterations)


def _tuned(state: _State, n_iterations: int) -> Fit:
    obs = state.line.obs
    fitted = _descend(state, n_iterations)
    best = (-np.inf, fitted.twin.accel_corner_s, fitted.twin.gyro_corner_s)
    walk, residual = fitted.system.walk, fitted.system.residual
    scaled = fitted.jacobian / fitted.scale
    blocks = [scaled[walk == w].T @ scaled[walk == w] for w in range(3)]
    sides = [scaled[walk == w].T @ residual[walk == w] for w in range(3)]
    sums = [float(residual[walk == w] @ residual[walk == w]) for w in range(3)]
    gyro_grid = CORNER_GRID_S if obs.rate_density is not None else (fitted.twin.gyro_corner_s,)
    # One sensor after the other, and the first again: their walks hardly meet in a row.
    for is_accel in (True, False, True):
        _, accel_best, gyro_best = best
        pairs = [(c, gyro_best) for c in CORNER_GRID_S] if is_accel else [(accel_best, c) for c in gyro_grid]
        for accel_corner, gyro_corner in pairs:
            factors = (1.0, accel_corner / fitted.twin.accel_corner_s, gyro_corner / fitted.twin.gyro_corner_s)
            normal = sum(f * f * b for f, b in zip(factors, blocks, strict=True))
            side = sum(f * f * s for f, s in zip(factors, sides, strict=True))
            normal[np.diag_indices_from(normal)] += RELATIVE_RIDGE
            half = np.linalg.cholesky(normal)
            inner = np.linalg.solve(half, side)
            chi2 = sum(f * f * s for f, s in zip(factors, sums, strict=True)) - float(inner @ inner)
            weight = sum(int((walk == w).sum()) * np.log(factors[w]) for w in (1, 2))
            evidence = -0.5 * chi2 - float(np.log(np.diag(half)).sum()) + weight
            if evidence > best[0]:
                best = (evidence, accel_corner, gyro_corner)
    return _fit_of(_descend(fitted.with_corners(best[1], best[2]), (n_iterations + 1) // 2))


CORNER_GRID_S = (20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 2560.0)
"""Corner times where white noise and bias walk meet. A bias that walks faster than 20 s is drift."""
