"""Every parameter over all sessions: what is common and how far it repeats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.estimate.sessions.spread import common_mean, spread_between, spread_within
from trihedron.records.sessions import PARAMETERS, Repeated, Session
from trihedron.refused import RefusedError


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
    groups = [session.group for session in sessions]
    if len(set(groups)) == len(groups):
        groups = [""] * len(groups)
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
