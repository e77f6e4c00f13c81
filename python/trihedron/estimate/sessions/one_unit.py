"""Whether recordings can be of one unit: its scales and axes change by little from session to session."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from trihedron.arrays import TINY
from trihedron.defaults import FALSE_ALARM
from trihedron.probability import ndtr
from trihedron.records.sessions import GEOMETRY, ONE_UNIT, PARAMETERS, Change, Session


def of_another_unit(sessions: Sequence[Session], changes: Sequence[Change]) -> tuple[Change, ...]:
    """Significant ``changes`` of the sessions that one unit does not make, the most significant first: of a
    misalignment, or of a scale by more than ``ONE_UNIT``.

    A scale common to all axes is not among them: a unit of measurement or a clock changes it as well.
    """
    apart = {*GEOMETRY, *_beyond_one_unit(sessions)}
    return tuple(sorted((c for c in changes if c.significant and c.id in apart), key=lambda c: c.p_adjusted))


def _beyond_one_unit(sessions: Sequence[Session]) -> set[str]:
    """Ids of scales and axis angles of which two sessions differ significantly by more than ``ONE_UNIT``."""
    fixed = [k for k, one in enumerate(PARAMETERS[: len(sessions[0].numbers)]) if not one.id.endswith("bias")]
    pairs = list(combinations(sessions, 2))
    found = set()
    for a, b in pairs:
        for k in fixed:
            away = float(abs(a.numbers[k] - b.numbers[k]))
            sigma = float(np.sqrt(max(a.covariance[k, k] + b.covariance[k, k], TINY)))
            if ndtr(-(away - ONE_UNIT) / sigma) * len(pairs) * len(fixed) < FALSE_ALARM:
                found.add(PARAMETERS[k].id)
    return found
