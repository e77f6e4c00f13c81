"""A zero that drifts in time though no logged channel explains it: what both sensors share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.drift_shapes import drift_variants, is_possible_drift, warm_up_variant
from trihedron.diagnose.session.twin import Distortion
from trihedron.diagnose.zeros.curve import DriftCurve, smooth_curve
from trihedron.diagnose.zeros.of_session import SessionEvidence
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Domain
from trihedron.records.words import why_not

AXES = ("x", "y", "z")
FEWEST_HOLDS = 6
"""Two shapes of drift on three axes are not told apart by fewer poses."""


class HiddenDrift(DirectEffect):
    """Warm-up exponential, straight line or slow curve per axis; where none of them fits, a free smooth curve."""

    is_late = True
    sensor: ClassVar[int]
    domain: ClassVar[Domain]
    unit: ClassVar[str]
    fewest_poses: ClassVar[int]
    """A free curve is told from scatter, or from the length of gravity, with this many poses."""

    @abstractmethod
    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        """Columns per axis from values (n, 3) of the instrument's axes."""

    @abstractmethod
    def only(self, columns: FloatArray) -> Distortion:
        """The distortion of this sensor alone."""

    @abstractmethod
    def evidence(self, context: Context) -> SessionEvidence | None:
        """What the zeros of the session are: a drift, a walk or scatter."""

    @abstractmethod
    def is_beyond_noise(self, context: Context, found: SessionEvidence, curve: DriftCurve) -> bool:
        """Whether the curve stands above what noise alone draws."""

    @abstractmethod
    def share(self, found: SessionEvidence, curve: DriftCurve) -> float:
        """Part of the excess χ² that the curve explains."""

    @abstractmethod
    def curve_variant(self, context: Context, curve: DriftCurve) -> Variant:
        """The curve itself, one column an axis: its factor is 1 where session and poses agree."""

    def unavailable(self, context: Context) -> str | None:
        if context.obs.flickers(self.sensor):
            return why_not("flickers")
        return why_not("six-poses") if context.obs.n_holds < FEWEST_HOLDS else None

    def variants(self, context: Context) -> list[Variant]:
        return drift_variants(context, self.on_axes(context), self.only, self.unit, self.n_waves(context.obs.n_holds))

    def n_waves(self, n_poses: int) -> int:  # noqa: ARG002
        """Cosines per axis that so many poses tell."""
        return 4

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        if variant.label != "warm-up":
            return None
        return warm_up_variant(context, self.on_axes(context), self.only, self.unit, value)

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        return is_possible_drift(variant, value)

    def made_again(self, context: Context, variant: Variant) -> Variant | None:
        if variant.label != "smooth":
            return super().made_again(context, variant)
        found = self.evidence(context)
        return None if found is None else self.curve_variant(context, _curve(context, found))

    def find(self, context: Context) -> Evidence | None:
        found = self.evidence(context)
        if found is None or found.evidence.n_poses < self.fewest_poses or not found.evidence.kind:
            return None
        curve = _curve(context, found)
        if not self.is_beyond_noise(context, found, curve):
            return None
        parameters = tuple(
            EffectParameter(f"range_{axis}", float(r), float(np.hypot(s[v.argmax()], s[v.argmin()])), self.unit)
            for axis, r, v, s in zip(AXES, curve.range, curve.values, curve.sigma, strict=True)
        )
        return Evidence(
            found.evidence.p_slow, 0.0, parameters, self.told(found.evidence.kind, range=curve.range), self.domain,
             variant=self.curve_variant(context, curve), share=self.share(found, curve),
            series={
                "time_s": curve.time_s.tolist(), "value": curve.values.tolist(), "sigma": curve.sigma.tolist(),
                "unit": self.unit,
            },
        )  # fmt: skip


def _curve(context: Context, found: SessionEvidence) -> DriftCurve:
    readings = found.zeros.readings
    every = list(range(readings.design.shape[1]))
    return smooth_curve(found.evidence.process, every, found.evidence.sigma, context.obs.hold_time_s)
