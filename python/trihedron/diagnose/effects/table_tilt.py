"""A table that is not level, seen by turning the sensor on it."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.table_turns import meant_as_multiples, table_turns
from trihedron.records.diagnosis import EffectParameter, Where


class TableTilt(DirectEffect):
    """Turning on a tilted table swings the vertical about the table's normal: it comes back only after a full turn."""

    id = "table-tilt"
    is_of_session = True
    mechanism = "the table is not level"
    experiment = "level the table, or hold every face in two headings 180° apart and average"

    def unavailable(self, context: Context) -> str | None:
        if not context.moves or not meant_as_multiples(table_turns(context)):
            return "the session has no turns on a table against a wall"
        return None

    def find(self, context: Context) -> Evidence | None:
        twin, obs = context.fitted.twin, context.obs
        chi2, dof, tilts, weights = 0.0, 0, [], []
        for turn in table_turns(context):
            before, after = obs.move_holds[turn.move]
            half = abs(np.sin(turn.angle_rad / 2.0))
            if half < 0.3:
                continue
            change = twin.up[after] - twin.up[before]
            sigma = float(
                np.sqrt(
                    ((twin.accel_S**2) @ (obs.hold_force_sigma[before] ** 2 + obs.hold_force_sigma[after] ** 2)).mean()
                )
            )
            sigma /= twin.gravity
            chi2 += float(change @ change) / sigma**2
            dof += 2
            tilts.append(float(np.linalg.norm(change)) / (2.0 * half))
            weights.append(half**2)
        if dof == 0:
            return None
        p = float(chdtrc(dof, chi2))
        tilt = float(np.degrees(np.average(tilts, weights=weights)))
        scatter = float(np.degrees(np.std(tilts))) / np.sqrt(len(tilts))
        # Feet, dust and hands tilt a case by a few hundredths of a degree on any table.
        if p > 1e-4 or tilt < 0.05 or tilt < 3.0 * scatter:
            return None
        return Evidence(
            max(p, 1e-300), chi2, (EffectParameter("tilt", tilt, max(scatter, 1e-4), "deg"),),
            f"The table is tilted by {tilt:.2f}°: turning the sensor on it moves the vertical in the body.",
            "static-accel", Where(("ax", "ay", "az")),
        )  # fmt: skip
