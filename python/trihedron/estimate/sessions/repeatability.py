"""Every parameter over all sessions: what is common and how far it repeats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.sessions.spread import common_mean, spread_between, spread_of_next, spread_within
from trihedron.records.sessions import PARAMETERS, Repeated, Session


def repeated_parameters(sessions: Sequence[Session]) -> tuple[Repeated, ...]:
    """The numbers of all sessions, one parameter after the other; sessions are grouped by their ``group``.

    Where every session is a group of its own there is one spread, from session to session, as ``within``.

    Raises
    ------
    ValueError
        With fewer than two sessions.
    """
    if len(sessions) < 2:
        raise RefusedError("one recording does not show how far a parameter repeats; give two or more.")
    groups = _groups(sessions)
    out = []
    for k, parameter in enumerate(PARAMETERS[: len(sessions[0].numbers)]):
        values = np.array([session.numbers[k] for session in sessions])
        own = np.array([max(float(session.covariance[k, k]), 1e-300) for session in sessions])
        within = spread_within(values, own, groups)
        between = spread_between(values, own, groups)
        mean = common_mean(values, own, groups, within, between)
        own_std = float(np.sqrt(np.median(own)))
        out.append(Repeated(parameter, mean.value, mean.std, mean.half_width, within, between, own_std))
    return tuple(out)


def next_session(sessions: Sequence[Session], repeated: Sequence[Repeated]) -> tuple[FloatArray, FloatArray]:
    """(k,) by how much the next session's numbers differ from the common ones, and the errors of those, one sigma.

    The axes of a kind repeat alike: three axes of two sessions say more of how far than one.
    """
    groups = _groups(sessions)
    numbers = np.array([session.numbers for session in sessions])
    own = np.array([np.maximum(np.diag(session.covariance), 1e-300) for session in sessions])
    within2, between2 = np.zeros(len(repeated)), np.zeros(len(repeated))
    for name in dict.fromkeys(one.parameter.id for one in repeated):
        of = [k for k, one in enumerate(repeated) if one.parameter.id == name]
        by_axis = [(axis, group) for axis in of for group in groups]
        within2[of] = spread_of_next(spread_within(numbers[:, of].T.ravel(), own[:, of].T.ravel(), by_axis)) ** 2
        between2[of] = np.mean([spread_of_next(repeated[k].between) ** 2 for k in of])
    error2 = np.maximum([one.std**2 for one in repeated], within2 / len(sessions) + between2 / len(set(groups)))
    return np.sqrt(within2 + between2), np.sqrt(error2)


def _groups(sessions: Sequence[Session]) -> list[str]:
    groups = [session.group for session in sessions]
    return [""] * len(groups) if len(set(groups)) == len(groups) else groups
