"""A relation as source of a user's own effect, for `diagnose`, `apply` and `calibrate --extended`."""

from __future__ import annotations

from trihedron.arrays import AXES
from trihedron.records.diagnosis import Relation


def effect_file(relation: Relation, effect_id: str = "named-relation") -> str | None:
    """Source of an effect with the relation's terms (docs/adding-an-effect.md); ``None`` where a term needs the past.

    Relations of force and rate can be computed from every sample; a previous pose, a last rotation or a heading cannot.
    """
    columns: list[tuple[int, str, str, str]] = []
    for coefficient in relation.coefficients:
        target, _, name = coefficient.name.partition(": ")
        expression = _expression(name)
        if expression is None or target not in AXES:
            return None
        columns.append((AXES.index(target), expression, f"c_{target}_{len(columns)}", coefficient.unit))
    is_gyro = relation.sensor == "gyroscope"
    only, needs = ("rate_only", "obs.raw_rate") if is_gyro else ("force_only", "obs.raw_force")
    class_name = "".join(word.capitalize() for word in effect_id.split("-"))
    rows = "\n".join(
        f"        values[:, {axis}, {k}] = {expression}" for k, (axis, expression, _, _) in enumerate(columns)
    )
    mechanism = relation.statement.split(":")[0]
    return f'''"""{mechanism}."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, {only}


class {class_name}(Effect):
    """{relation.form}."""

    id = "{effect_id}"
    mechanism = "{mechanism}"
    experiment = "{relation.experiment}"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        return "the log has no such sensor" if context.{needs} is None else None

    def variants(self, context: Context) -> list[Variant]:
        u, w = context.force / np.linalg.norm(context.force[:1], axis=1), context.rate
        values = np.zeros((context.n_points, 3, {len(columns)}))
{rows}
        # From the sensor's own axes to the instrument's.
        axes = context.{"gyro_axes" if is_gyro else "accel_axes"}
        columns = np.einsum("ij,njk->nik", axes, values)
        return [Variant({only}(columns), {tuple(c[2] for c in columns)!r}, {tuple(c[3] for c in columns)!r})]
'''


def _expression(name: str) -> str | None:
    """Python expression of a term in the generated effect, or ``None``."""
    table = {"|w|": "np.linalg.norm(w, axis=1)"}
    for i, a in enumerate(AXES):
        table |= {
            f"u_{a}^2": f"u[:, {i}] ** 2", f"u_{a}^3": f"u[:, {i}] ** 3", f"|u_{a}|": f"np.abs(u[:, {i}])",
            f"w_{a}": f"w[:, {i}]",
        }  # fmt: skip
        for k, b in enumerate(AXES):
            table |= {
                f"u_{a} u_{b}": f"u[:, {i}] * u[:, {k}]", f"w_{a} w_{b}": f"w[:, {i}] * w[:, {k}]",
                f"w_{a} f_{b}": f"w[:, {i}] * u[:, {k}]",
            }  # fmt: skip
    return table.get(name)
