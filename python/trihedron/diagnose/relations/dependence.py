"""A dependence of readings on variables, as an effect without a mechanism (docs/relations.md)."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, acting_on
from trihedron.records.domains import Domain

ALL_AXES = (0, 1, 2)
Column = tuple[str, FloatArray, str]
"""Name, values (points,) and unit of one variable."""


class Dependence(Effect):
    """Dependence of a sensor on variables, without a mechanism: an effect that is in no catalogue.

    ``names`` and ``units`` (k,) as reported, ``values`` (points, k). ``family`` selects the text of the experiment;
    ``is_motion`` marks variables that are zero in static poses. ``axes`` are the sets of sensor axes that may depend on
    them: parameters run over the axes, and for each over the names.
    """

    def __init__(
        self, sensor: int, family: str, columns: Sequence[Column], *, is_motion: bool = False,
        axes: Sequence[tuple[int, ...]] = ((0,), (1,), (2,), ALL_AXES),
    ) -> None:  # fmt: skip
        self.sensor, self.family, self.is_motion, self.axes = sensor, family, is_motion, axes
        self.names, self.units = tuple(name for name, *_ in columns), tuple(unit for *_, unit in columns)
        self.values = np.stack([values for _, values, _ in columns], axis=1)
        self.id = f"{('accelerometer', 'gyroscope')[sensor]}: {', '.join(self.names)}"

    @property
    def domain(self) -> Domain:
        """The domain of residuals in which it shows."""
        if self.is_motion:
            return "moves" if self.sensor else "dynamics"
        return "static-gyro" if self.sensor else "static-accel"

    def variants(self, context: Context) -> list[Variant]:
        values = self.values if self.is_motion else self.values - self.values[: context.obs.n_poses].mean(axis=0)
        k, own = len(self.names), context.gyro_axes if self.sensor else context.accel_axes
        whole = acting_on(self.sensor, np.einsum("ia,nk->niak", own, values).reshape(len(values), 3, -1))
        out = []
        for axes in self.axes:
            part = tuple(a * k + j for a in axes for j in range(k))
            names = tuple(f"{AXES[a]}: {name}" for a in axes for name in self.names)
            units, label = self.units * len(axes), "".join(AXES[a] for a in axes)
            out.append(Variant(whole.of(part), names, units, label=label, part_of=(whole, part)))
        return out
