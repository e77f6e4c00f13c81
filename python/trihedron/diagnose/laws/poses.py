"""Zeros at rest as misfits of the dictionary: every gyro axis, and the length of specific force."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.laws.misfit import Misfit, misfit_of
from trihedron.diagnose.laws.search import Candidate
from trihedron.diagnose.laws.signals import AXES, Signal, pose_signals, room_vectors
from trihedron.diagnose.zeros.curve import covariance_of
from trihedron.diagnose.zeros.evidence import ALL, FEWEST_POSES
from trihedron.diagnose.zeros.process import ZeroProcess
from trihedron.diagnose.zeros.readings import SessionZeros, accel_zeros, gyro_zeros


@dataclass(frozen=True, eq=False)
class Zeros:
    """Misfits of one sensor's zeros (one per gyro axis, one of the accelerometer), with the candidates of each."""

    sensor: str
    misfits: tuple[Misfit, ...]
    candidates: tuple[tuple[Candidate, ...], ...]
    poses: npt.NDArray[np.intp]
    room: FloatArray | None
    """(poses, 3, 3) level → body."""


def gyro_misfits(context: Context) -> Zeros | None:
    """Rates at rest of the three gyros, pose by pose; the local zero is what the base columns leave."""
    if context.obs.n_holds < FEWEST_POSES:
        return None
    zeros = gyro_zeros(context)
    if zeros is None:
        return None
    # Gravity competes as a candidate here: it is not taken off beforehand.
    zeros = _with_design(zeros, [0])
    y, V, poses = _pose_means(zeros)
    misfits = tuple(misfit_of(y[k], np.ones((len(poses), 1)), V[k], np.arange(len(poses))) for k in range(3))
    room = room_vectors(context)
    signals = [_at(s, poses) for s in pose_signals(context)]
    candidates = tuple(
        tuple(
            Candidate(
                AXES[k], s.family, s.names, s.unit, misfits[k].columns(s.values), _mover(s.values, None), s.is_smooth,
                is_known=s.names == ("u_x", "u_y", "u_z"),
            )
            for s in signals
        )
        for k in range(3)
    )  # fmt: skip
    return Zeros("gyroscope", misfits, candidates, poses, None if room is None else room[poses])


def accel_misfits(context: Context) -> Zeros | None:
    """Lengths of specific force at rest against S and b; a law of accelerometer j shows along the vertical only."""
    if context.obs.n_holds < FEWEST_POSES:
        return None
    zeros = accel_zeros(context)
    if zeros is None:
        return None
    zeros = _with_design(zeros, [c for c in range(zeros.readings.design.shape[1]) if c not in zeros.thermal])
    y, V, poses = _pose_means(zeros)
    base = np.array([zeros.readings.design[zeros.readings.pose == i].mean(axis=0) for i in poses])
    misfit = misfit_of(y[0], base, V[0], np.arange(len(poses)))
    along = context.fitted.twin.up[poses] @ context.accel_axes
    out = []
    for k in range(3):
        for s in pose_signals(context):
            if s.names == ("u_x", "u_y", "u_z"):
                continue  # a zero that follows gravity is a scale or a misalignment
            one = _at(s, poses)
            out.append(
                Candidate(
                    AXES[k], s.family, s.names, s.unit, misfit.columns(along[:, [k]] * one.values),
                    _mover(one.values, along[:, [k]]), s.is_smooth,
                )
            )  # fmt: skip
    room = room_vectors(context)
    return Zeros("accelerometer", (misfit,), (tuple(out),), poses, None if room is None else room[poses])


def _mover(values: FloatArray, along: FloatArray | None):  # type: ignore[no-untyped-def]
    return lambda order: values[order] if along is None else along * values[order]


def _at(signal: Signal, poses: npt.NDArray[np.intp]) -> Signal:
    return replace(signal, values=signal.values[poses])


def _with_design(zeros: SessionZeros, keep: list[int]) -> SessionZeros:
    return replace(zeros, readings=replace(zeros.readings, design=zeros.readings.design[:, keep]))


def _pose_means(zeros: SessionZeros) -> tuple[FloatArray, list[FloatArray], npt.NDArray[np.intp]]:
    """Means of poses (axes, h), covariances (h, h) with scatter, walk and drift as REML has them, pose numbers."""
    r = zeros.readings
    process = ZeroProcess.of(r)
    _, sigma = process.maximum(ALL, list(range(r.design.shape[1])), restricted=True)
    poses = np.unique(r.pose)
    average = (r.pose[None, :] == poses[:, None]).astype(np.float64)
    average /= average.sum(axis=1, keepdims=True)
    y = r.values @ average.T
    V = [average @ covariance_of(process, k, sigma)[0] @ average.T for k in range(len(r.values))]
    return y, V, poses.astype(np.intp)
