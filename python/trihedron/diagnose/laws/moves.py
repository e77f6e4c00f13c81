"""Moves as a misfit of the dictionary: rates and forces that only motion has (eq. L.7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.laws.misfit import Columns, Misfit
from trihedron.diagnose.laws.search import Candidate
from trihedron.diagnose.laws.signals import AXES
from trihedron.diagnose.session.solve import Reduced, leverage, reduce
from trihedron.diagnose.session.twin import DYNAMICS, MOVES, Distortion

FEWEST_MOVES = 12
"""Two in each of the six blocks that are left out in turn."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The misfit of all moves, and candidates of both sensors on it."""

    misfit: Misfit
    gyro: tuple[Candidate, ...]
    accel: tuple[Candidate, ...]


def move_misfit(context: Context) -> Motion | None:
    """Angles and velocities over all moves, everything that the session fits projected out."""
    fitted = context.fitted
    if context.obs.n_moves < FEWEST_MOVES:
        return None
    system = fitted.system
    rows = np.flatnonzero(np.isin(system.domain, (MOVES, DYNAMICS)))
    reduced = reduce(fitted)
    used = leverage(fitted)
    scale = np.ones(len(rows))
    dof = 0.0
    for domain in (MOVES, DYNAMICS):
        own = system.domain == domain
        free = float((1.0 - used[own]).sum())
        dof += free
        # One variance per domain: what stays unexplained is noise to a law.
        spread = float((system.residual[own] ** 2).sum()) / max(free, 1.0)
        scale[system.domain[rows] == domain] = np.sqrt(max(spread, 1e-12))
    chosen = np.zeros((len(system.residual), len(rows)))
    chosen[rows, np.arange(len(rows))] = 1.0
    P = reduced.project(chosen)[rows]
    P = 0.5 * (P + P.T)
    residual = system.residual[rows] / scale
    misfit = Misfit(P, residual, float(residual @ residual), dof, system.segment[rows].astype(np.intp))
    gyro = _candidates(context, reduced, misfit, rows, scale, is_gyro=True)
    accel = _candidates(context, reduced, misfit, rows, scale, is_gyro=False)
    return Motion(misfit, gyro, accel)


def _signals(context: Context, *, is_gyro: bool) -> list[tuple[str, str, str, FloatArray]]:
    """(family, name, unit, (points,)) variables that vanish at rest."""
    w, g = context.rate, context.fitted.twin.gravity
    size = np.linalg.norm(w, axis=1)
    out: list[tuple[str, str, str, FloatArray]] = []
    for a in range(3):
        for b in range(a, 3):
            name = f"w_{AXES[a]} w_{AXES[b]}" if a != b else f"w_{AXES[a]}^2"
            out.append(("rate products", name, "(rad/s)^2", w[:, a] * w[:, b]))
        out.append(("rate", f"w_{AXES[a]} |w_{AXES[a]}|", "(rad/s)^2", w[:, a] * np.abs(w[:, a])))
        out.append(("angular acceleration", f"dw_{AXES[a]}/dt", "rad/s^2", context.angular_acceleration[:, a]))
        out.append(("force rate", f"df_{AXES[a]}/dt", "m/s^3", context.force_rate[:, a]))
    out.append(("rate", "|w|", "rad/s", size))
    if is_gyro:
        for a in range(3):
            for b in range(3):
                name = f"w_{AXES[a]} f_{AXES[b]}"
                out.append(("rate times force", name, "rad/s g", w[:, a] * context.force[:, b] / g))
        if context.temperature is not None and np.ptp(context.temperature) > LEAST_SWING_K:
            T = context.temperature
            out += [("temperature", f"T w_{AXES[a]}", "K rad/s", T * w[:, a]) for a in range(3)]
    else:
        out += [("rate", f"w_{AXES[a]}", "rad/s", w[:, a]) for a in range(3)]
    return out


def _candidates(
    context: Context,
    reduced: Reduced,
    misfit: Misfit,
    rows: npt.NDArray[np.intp],
    scale: FloatArray,
    *,
    is_gyro: bool,
) -> tuple[Candidate, ...]:
    signals = _signals(context, is_gyro=is_gyro)
    values = np.stack([s[3] for s in signals], axis=1)
    axes = context.gyro_axes if is_gyro else context.accel_axes
    starts = np.flatnonzero(np.diff(misfit.unit, prepend=-1))
    out = []
    for k in range(3):
        columns = axes[None, :, [k]] * values[:, None, :]
        distortion = Distortion(None, columns) if is_gyro else Distortion(columns, None)
        projected = reduced.project(context.fitted.line.columns(distortion))[rows] / scale[:, None]
        for j, (family, name, unit, _) in enumerate(signals):
            # Columns say how residuals change when a parameter takes its effect off the readings: the law adds it.
            one = -projected[:, [j]]
            made = Columns(one, one, one.T @ misfit.Py)
            out.append(Candidate(AXES[k], family, (name,), unit, made, _mover(one, starts, misfit.unit)))
    return tuple(out)


def _mover(projected: FloatArray, starts: npt.NDArray[np.intp], unit: npt.NDArray[np.intp]):  # type: ignore[no-untyped-def]
    """The rows of moves in another order; every move has as many."""
    blocks = np.split(projected, starts[1:])

    def moved(order: npt.NDArray[np.intp]) -> FloatArray:
        out = np.concatenate([blocks[k] for k in order])
        return out if len(out) == len(unit) else projected

    return moved
