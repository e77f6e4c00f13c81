"""A bias that drifts in time though no logged channel explains it: what both sensors share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_process import BiasProcess, per_axis_parameters
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.effects.drift_shapes import drift_variants, is_possible_drift, warm_up_variant
from trihedron.diagnose.session.twin import Distortion
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words


class BiasDrift(BiasProcess):
    """Warm-up exponential, straight line or slow curve per axis, or a walk stronger than the part's noise explains."""

    walks = True
    typical: ClassVar[float]
    """How far parts drift while they warm up, one sigma, SI."""

    @abstractmethod
    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        """Columns per axis from values (n, 3) of the instrument's axes."""

    @abstractmethod
    def only(self, columns: FloatArray) -> Distortion:
        """The distortion of this sensor alone."""

    def variants(self, context: Context) -> list[Variant]:
        return drift_variants(context, self.on_axes(context), self.only, self.unit, self.n_waves(context.obs.n_poses))

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        return np.full(variant.distortion.n_parameters, self.typical)

    def n_waves(self, n_poses: int) -> int:  # noqa: ARG002
        """Cosines per axis that so many poses tell."""
        return 4

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        if variant.label != "warm-up":
            return None
        return warm_up_variant(context, self.on_axes(context), self.only, self.unit, value)

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        return is_possible_drift(variant, value)

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        return per_axis_parameters("range", size, std, self.unit), self.told("walk", range=size)
