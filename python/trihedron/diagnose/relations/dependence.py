"""A dependence of readings on variables, as an effect without a mechanism (docs/relations.md)."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import SENSORS, Effect, Variant, acting_on
from trihedron.records.domains import Domain

Column = tuple[str, FloatArray, str]
"""Name, values (points,) and unit of one variable."""


class Dependence(Effect):
    """Dependence of a sensor on variables, without a mechanism: an effect that is in no catalogue.

    ``courses`` are sets of variables that compete. ``family`` selects the text of the experiment; ``is_motion`` marks
    what is zero in static poses. ``parts`` are the sets of columns of :meth:`base` that may depend on them: parameters
    run over the columns, and for each over the variables.
    """

    def __init__(
        self, sensor: int, family: str, *courses: Sequence[Column], is_motion: bool = False,
        parts: Sequence[tuple[int, ...]] = ((0,), (1,), (2,), (0, 1, 2)),
    ) -> None:  # fmt: skip
        self.sensor, self.family, self.is_motion, self.parts, self.courses = sensor, family, is_motion, parts, courses
        self.names = tuple(name for course in courses for name, *_ in course)
        self.id = f"{SENSORS[sensor].name} {family}: {', '.join(self.names)}"

    @property
    def domain(self) -> Domain:
        """The domain of residuals in which it shows."""
        if self.is_motion:
            return "moves" if self.sensor else "dynamics"
        return SENSORS[self.sensor].domain

    def base(self, context: Context) -> tuple[FloatArray, Sequence[str]]:
        """Columns (points or 1, 3, m) that are multiplied by the variables, and their names: one along each axis."""
        return (context.gyro_axes if self.sensor else context.accel_axes)[None], [f"{axis}:" for axis in AXES]

    def variants(self, context: Context) -> list[Variant]:
        base, along = self.base(context)
        out = []
        for course in self.courses:
            said, columns, units = zip(*course, strict=True)
            values, k = np.stack(columns, axis=1), len(course)
            if not self.is_motion:
                values = values - values[: context.obs.n_poses].mean(axis=0)
            products = np.einsum("nip,nj->nipj", np.broadcast_to(base, (len(values), *base.shape[1:])), values)
            whole = acting_on(self.sensor, products.reshape(len(values), 3, -1))
            for of in self.parts:
                part = tuple(p * k + j for p in of for j in range(k))
                names = tuple(f"{along[p]} {name}" for p in of for name in said)
                label = ", ".join(names)
                out.append(Variant(whole.of(part), names, units * len(of), label=label, part_of=(whole, part)))
        return out
