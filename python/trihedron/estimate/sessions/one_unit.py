"""Whether recordings can be of one unit: its scales and axes change by little from session to session."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from trihedron.defaults import FALSE_ALARM
from trihedron.probability import ndtr
from trihedron.records.sessions import ONE_UNIT, PARAMETERS, Parameter, Session


def beyond_one_unit(sessions: Sequence[Session]) -> tuple[tuple[Parameter, float], ...]:
    """Scales and axis angles of which two sessions differ significantly by more than ``ONE_UNIT``, with the largest
    such difference, the largest first."""
    fixed = [k for k, one in enumerate(PARAMETERS[: len(sessions[0].numbers)]) if not one.id.endswith("bias")]
    pairs = list(combinations(sessions, 2))
    worst: dict[int, float] = {}
    for a, b in pairs:
        for k in fixed:
            away = float(abs(a.numbers[k] - b.numbers[k]))
            sigma = float(np.sqrt(max(a.covariance[k, k] + b.covariance[k, k], 1e-300)))
            if ndtr(-(away - ONE_UNIT) / sigma) * len(pairs) * len(fixed) < FALSE_ALARM:
                worst[k] = max(away, worst.get(k, 0.0))
    return tuple((PARAMETERS[k], worst[k]) for k in sorted(worst, key=lambda k: -worst[k]))
