"""Relations that compete with names: columns like an effect's, asked beside what was found (docs/relations.md)."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Variant, rate_only
from trihedron.diagnose.hypothesis import Hypothesis, Term, again

ROOM_RAD_S = 1e-3
"""0.05 °/s: what a magnet near a consumer gyro, or a drive's field, is known to do."""


def room_field(context: Context, directions: int) -> Variant:
    """A rate that follows a vector fixed in the room: its two horizontal parts, or the vertical one too."""
    attitude = np.where(np.isfinite(context.hold_attitude), context.hold_attitude, 0.0)
    # Any coupling of the body's axes to every direction of the room.
    carried = context.between_holds(attitude)[:, :, :directions]
    columns: FloatArray = np.einsum("kij,njh->nikh", np.eye(9).reshape(9, 3, 3), carried)
    k = 9 * directions
    return Variant(rate_only(columns.reshape(len(carried), 3, k)), tuple(f"K{i}" for i in range(k)), ("rad/s",) * k)


def with_room_field(model: Hypothesis, alpha: float) -> Hypothesis:
    """The hypothesis with a vector fixed in the room beside it, where the session demands one; else as it is."""
    if model.obs.raw_rate is None or not model.context.moves or not follows_room(model, alpha):
        return model
    return again(model, [*model.terms, _room(model, 3)])


def follows_room(model: Hypothesis, alpha: float) -> bool:
    """Whether horizontal directions of the room are demanded beside everything that a hypothesis holds."""
    room = _room(model, 2)
    beside = max(one.log_evidence for one in model.asked([room]))
    return bool(2.0 * (beside - model.plain([])) - room.paid > -2.0 * np.log(2.0 * alpha))


def _room(model: Hypothesis, directions: int) -> Term:
    variant = room_field(model.context, directions)
    return Term(catalogue()[0], variant, np.full(9 * directions, ROOM_RAD_S), 2.0 * float(np.log(len(catalogue()))))


def without_doubtful(model: Hypothesis, alpha: float) -> Hypothesis:
    """The hypothesis without a g-sensitivity that a vector fixed in the room stands beside.

    The vertical part of such a vector is a g-sensitivity: only its horizontal parts tell the two apart.
    """
    kept = [term for term in model.terms if term.effect.id != "gyro-g-sensitivity"]
    if len(kept) == len(model.terms) or not follows_room(model, alpha):
        return model
    return again(model, kept)
