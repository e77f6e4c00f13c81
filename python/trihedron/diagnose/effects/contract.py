"""What an effect is: a mechanism that predicts, per parameter, what it adds to the readings.

To add one: write a file in this folder with a subclass of :class:`Effect` and nothing else (docs/adding-an-effect.md).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.state import Distortion
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Domain
from trihedron.records.words import Words, effect_words, experiment_for, why_not

TYPICAL_M_S2, TYPICAL_RAD_S = 0.03, 2e-3
"""3 mg and 0.1 °/s: what consumer parts stray by."""
LEAST_RMS = 1e-12
"""Columns that never add anything have any size."""
SHAPE_NAMES = ("time_constant", "half_width", "pose")
"""Nonlinear parameters, chosen from a grid and refined on the profile likelihood."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One shape of an effect: the distortion per unit of each parameter, and the shape numbers it was made with.

    ``shape`` are nonlinear parameters (time constants, widths) chosen from a grid; each costs as a parameter does.
    ``scale`` is what one of a linear parameter stands for in the unit that is reported, ``given`` what is known of the
    place (its gravity) and bounds what the parameters can be. ``stands_for_many`` is set on one of a family of shapes
    that is tried for all of it (a filter's order and damping): a plain mechanism that explains as much goes before it.
    """

    distortion: Distortion
    names: tuple[str, ...]
    units: tuple[str, ...]
    shape: dict[str, tuple[float, str]] = field(default_factory=dict)
    label: str = ""
    shape_sigma: float = 0.0
    scale: float = 1.0
    given: dict[str, float] = field(default_factory=dict)
    stands_for_many: bool = False


class Effect(ABC):
    """One physical mechanism."""

    id: ClassVar[str]
    mechanism: ClassVar[str] = ""
    """What it is called, of an effect that a user's own file adds: the words of ours stand in ``report/effects``."""
    experiment: ClassVar[str] = ""
    """What to record so that a user's own effect cannot be mistaken for another."""
    applies_elsewhere: ClassVar[bool] = False
    """Whether the fitted effect can be taken off another recording of the same sensor, from logged signals alone."""
    needs_moves: ClassVar[bool] = False
    """Whether it shows in nothing but moves between poses, which need a gyro."""
    repeatable: ClassVar[bool] = False
    """Whether it may be accepted more than once (another pose, another line)."""

    accounts_for: ClassVar[tuple[Domain, ...]] = ()
    """Domains of samples whose disagreement is this effect itself, seen from another side."""

    is_spread: ClassVar[bool] = False
    """Whether it only says how far something scatters, not why: mechanisms are named before it."""
    is_of_session: ClassVar[bool] = False
    """Whether it belongs to one experiment (a pushed pose, a tilted table) and to no instrument."""
    is_of_motion: ClassVar[bool] = False
    """Whether it belongs to how the sensor was moved (the arm it was turned on): another session has another."""
    is_of_samples: ClassVar[bool] = False
    """Whether the share that it states is one of the variance inside poses (a line)."""
    leaves_open: ClassVar[tuple[str, ...]] = ()
    """Numbers (ids) whose level depends on where the effect is counted from: a zero at the session's mean temperature
    is no other zero than one at 25 °C."""
    drifts_as: ClassVar[str] = ""
    """The effect (id) that it is in a log without its channel: what follows a temperature that nobody logged drifts."""
    is_local: ClassVar[bool] = False
    """Whether it concerns one pose or move only: its gain may then come from one block of held-out data."""

    size: ClassVar[float] = 0.0
    """How large one parameter is in parts as data sheets have them, one sigma, in the unit that is reported; 0 where
    :meth:`sizes` says so."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        """(k,) how large every parameter of a variant is expected to be, one sigma.

        Of an effect that does not say so: what adds a few mg, or a tenth of a degree per second, to the readings.
        """
        if self.size > 0.0:
            return np.full(variant.distortion.n_parameters, self.size / abs(variant.scale))
        out = np.full(variant.distortion.n_parameters, np.inf)
        for side, typical in ((variant.distortion.force, TYPICAL_M_S2), (variant.distortion.rate, TYPICAL_RAD_S)):
            if side is not None:
                rms = np.sqrt(np.mean(np.sum(side**2, axis=1), axis=0))
                out = np.minimum(out, typical / np.maximum(rms, LEAST_RMS))
        return out

    def unavailable(self, context: Context) -> str | None:
        """Why this recording cannot show the effect; ``None`` when it can."""
        return why_not("no-moves") if self.needs_moves and not context.moves else None

    @abstractmethod
    def variants(self, context: Context) -> list[Variant]:
        """Forward models to compete, simplest first; SI, at the context's points."""

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:  # noqa: ARG002
        """The same variant at another value of its one shape number; ``None`` where the shape is not continuous."""
        return None

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:  # noqa: ARG002
        """A scaled variant made again for the size it was found to have; ``None`` where columns do not depend on it."""
        return None

    def is_plausible(self, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        """Whether the fitted parameters are ones that the mechanism can have."""
        return True

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        """The same where it depends on the shape."""
        return self.is_plausible(value, covariance)

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        """Physical parameters from the linear ones; shape numbers follow without a standard error of their own."""
        sigma = abs(variant.scale) * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        linear = tuple(
            EffectParameter(name, variant.scale * float(v), float(s), unit)
            for name, v, s, unit in zip(variant.names, value, sigma, variant.units, strict=True)
        )
        shape = tuple(EffectParameter(name, v, variant.shape_sigma, unit) for name, (v, unit) in variant.shape.items())
        return linear + shape

    def n_shape(self, parameters: tuple[EffectParameter, ...]) -> int:
        """How many of the parameters, at the end, are shape numbers."""
        return sum(1 for p in parameters if p.name in SHAPE_NAMES)

    def told(self, case: str, /, **values: Any) -> Words:
        """The catalogue's sentence for this effect, by case and values (SI)."""
        return effect_words(self.id, case, **values)

    def statement(self, parameters: tuple[EffectParameter, ...]) -> str:
        """What is said of it where it competed with others: the mechanism with its strongest term."""
        strongest = max(
            parameters[: len(parameters) - self.n_shape(parameters)], key=lambda p: abs(p.value) / max(p.std, 1e-300)
        )
        return self.told(
            "strongest", mechanism=self.mechanism, name=strongest.name, value=strongest.value, std=strongest.std,
            unit=strongest.unit,
        )  # fmt: skip

    def separating_experiment(self) -> str:
        """What to record so that it cannot be mistaken for another."""
        return experiment_for(self.id) or self.experiment


def per_axis(symbol: str) -> tuple[str, ...]:
    """Names of one parameter per axis."""
    return tuple(f"{symbol}_{axis}" for axis in AXES)


def force_only(columns: FloatArray) -> Distortion:
    """A distortion of the accelerometer alone."""
    return Distortion(columns, None)


def rate_only(columns: FloatArray) -> Distortion:
    """A distortion of the gyro alone."""
    return Distortion(None, columns)
