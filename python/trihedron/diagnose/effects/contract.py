"""The interface of an effect: a mechanism that predicts, per parameter, what it adds to the readings.

To add one: write a file in this folder with a subclass of :class:`Effect` and nothing else (docs/adding-an-effect.md).
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from trihedron.arrays import AXES, TINY, FloatArray, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Distortion
from trihedron.probability import LEAST_P
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Domain, HeldOut, Where
from trihedron.records.words import Words, effect_words, experiment_for, why_not
from trihedron.session.drift import TYPICAL


class Side(NamedTuple):
    """How one sensor is called in variants, in names of parameters and in records, the SI unit of its readings, and the
    domain of its static residuals."""

    label: str
    prefix: str
    name: Literal["accelerometer", "gyroscope"]
    unit: str
    domain: Domain


SENSORS = (
    Side("accelerometer", "accel", "accelerometer", "m/s^2", "static-accel"),
    Side("gyro", "gyro", "gyroscope", "rad/s", "static-gyro"),
)
ACCELEROMETER, GYRO = range(len(SENSORS))
PRIOR_SCALES = (1.0, 0.3, 0.1)
"""Prior widths tried, as factors on the data-sheet size of an effect: parts of a kind differ tenfold."""
SHAPE_NAMES = ("time_constant", "half_width", "pose", "thermometer_lag", "step_time")
"""Names of the shape parameters, which are nonlinear: chosen from a grid, refined at the maximum of the evidence."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One shape of an effect: the distortion per unit of each parameter, and the shape parameters it was computed with.

    ``shape`` are nonlinear parameters (time constants, widths) chosen from a grid; the score corrects for their number.
    ``scale`` converts a linear parameter to the reported unit.
    """

    distortion: Distortion
    names: tuple[str, ...]
    units: tuple[str, ...]
    shape: dict[str, tuple[float, str]] = field(default_factory=dict)
    label: str = ""
    shape_sigma: float = 0.0
    scale: float = 1.0
    n_places: float = 1.0
    """Shapes among which this one was chosen beforehand, for each that is offered."""
    part_of: tuple[Distortion, tuple[int, ...]] | None = None
    """Columns of several variants, and which of them are its own: such variants are screened together."""


class Effect:
    id: str = ""
    mechanism: ClassVar[str] = ""
    """Name of an effect from a user's own file; the texts of the built-in effects are in ``report/effects``."""
    experiment: ClassVar[str] = ""
    """What to record to separate a user's own effect from others."""
    applies_elsewhere: ClassVar[bool] = False
    """Whether the effect can be compensated in another recording of the same sensor, from logged signals alone."""
    needs_moves: ClassVar[bool] = False
    """Whether it shows only in moves between poses, which need a gyro."""
    needs_gyro: ClassVar[bool] = False
    accounts_for: ClassVar[tuple[Domain, ...]] = ()
    """Domains of samples whose disagreement this effect explains."""

    is_spread: ClassVar[bool] = False
    """Whether it is only the size of a scatter, without a cause: mechanisms are named before it."""
    of_session: ClassVar[tuple[str, ...] | None] = ()
    """Parameters that a session sets anew, as the heading in which it began; None are all, where it belongs to one
    experiment (a disturbed pose, a tilted table) and not to the instrument."""
    is_of_motion: ClassVar[bool] = False
    """Whether it belongs to the motion of one session (the arm to the centre of rotation)."""
    is_of_samples: ClassVar[bool] = False
    """Whether its stated share is one of the variance inside poses (a line)."""
    confounded_with: ClassVar[tuple[str, ...]] = ()
    """Ids of parameters whose value depends on the reference point of the effect: the bias at the session's mean
    temperature is not the bias at 25 °C."""
    is_of_true_motion: ClassVar[bool] = False
    """Whether its columns are functions of the true motion, not of the reading: derivatives of the reading invert a
    low-pass."""
    is_local: ClassVar[bool] = False
    """Whether it concerns one pose only: its gain may come from one fold of the cross-validation, and it may be
    accepted once for each of several poses."""

    @property
    def is_minor(self) -> bool:
        """Whether it is a scatter without a cause, or concerns one pose."""
        return self.is_spread or self.is_local

    size: ClassVar[float] = 0.0
    """Typical size of one parameter in data sheets, one sigma, in the reported unit; 0 where :meth:`sizes` is
    overridden."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        """(k,) expected size of every parameter of a variant, one sigma.

        Default without ``size``: the size that adds to the readings, rms, what a bias changes while parts warm up.
        """
        if self.size > 0.0:
            return np.full(variant.distortion.n_parameters, self.size / abs(variant.scale))
        out = np.full(variant.distortion.n_parameters, np.inf)
        for side, typical in zip((variant.distortion.force, variant.distortion.rate), TYPICAL, strict=True):
            if side is not None:
                rms = np.sqrt(np.einsum("nik,nik->k", side, side) / len(side))
                out = np.minimum(out, typical / np.maximum(rms, TINY))
        return out

    def unavailable(self, context: Context) -> str | None:
        """Why this recording cannot show the effect, or ``None``."""
        if self.needs_gyro and context.obs.raw_rate is None:
            return why_not("no-gyro")
        return why_not("no-moves") if self.needs_moves and not context.moves else None

    def variants(self, context: Context) -> list[Variant]:  # noqa: ARG002
        """Forward models that compete, simplest first; SI, at the context's points. None where it shows otherwise."""
        return []

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:  # noqa: ARG002
        """The same variant at another value of its one shape parameter; ``None`` where the shape is not continuous."""
        return None

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:  # noqa: ARG002
        """A scaled variant computed again for its fitted size; ``None`` where its columns do not depend on the size."""
        return None

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        """Whether the mechanism can have the fitted parameters of a variant."""
        return True

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        """Physical parameters from the linear ones, then the shape parameters with ``shape_sigma`` as uncertainty."""
        sigma = abs(variant.scale) * sigmas_of(covariance)
        linear = measured(variant.names, variant.scale * value, sigma, variant.units)
        shape = tuple(EffectParameter(name, v, variant.shape_sigma, unit) for name, (v, unit) in variant.shape.items())
        return linear + shape

    def reported(self, case: str, /, **values: Any) -> Words:
        """The catalogue's sentence for this effect, by case and values (SI)."""
        return effect_words(self.id, case, **values)

    def statement(self, parameters: tuple[EffectParameter, ...]) -> str:
        """Sentence for an effect selected by the search: the mechanism with its most significant parameter."""
        linear = [p for p in parameters if p.name not in SHAPE_NAMES]
        strongest = max(linear, key=lambda p: abs(p.value) / max(p.std, TINY))
        return self.reported(
            "strongest", mechanism=self.mechanism, name=strongest.name, value=strongest.value, std=strongest.std,
            unit=strongest.unit,
        )  # fmt: skip

    def separating_experiment(self) -> str:
        return experiment_for(self.id) or self.experiment


@dataclass(frozen=True, eq=False)
class Evidence:
    """Result of a direct test.

    ``p_value`` is not corrected for the number of effects tested; ``held_out`` compares before and after on data that
    the parameters were not fitted to; ``reweigh`` changes the observations (noise, excluded moves), or is None;
    ``strength`` is the gain in twice a log-likelihood, for ranking.
    ``share`` is the share of its domain's misfit that it explains, for effects that do not show in poses and moves.
    ``statement`` is the catalogue's (:meth:`Effect.reported`), or that of a user's own effect.
    ``restate`` gives the parameters again from the session fitted with ``reweigh`` applied.
    """

    p_value: float
    strength: float
    parameters: tuple[EffectParameter, ...]
    statement: str
    domain: Domain
    where: Where = field(default_factory=Where)
    held_out: tuple[HeldOut, ...] = ()
    reweigh: Callable[[Observations], Observations] | None = None
    restate: Callable[[Context], tuple[EffectParameter, ...]] | None = None
    share: float | None = None

    def __post_init__(self) -> None:
        """Keep the p-value where its logarithm exists."""
        object.__setattr__(self, "p_value", min(max(float(self.p_value), LEAST_P), 1.0))


class DirectEffect(Effect):
    """An effect detected by a test on the samples, with evidence of its own, not by columns over poses."""

    @abstractmethod
    def find(self, context: Context) -> Evidence | None:
        """The evidence for the effect in this recording, or ``None``."""


def measured(
    names: Sequence[str], value: FloatArray, std: FloatArray, units: Sequence[str]
) -> tuple[EffectParameter, ...]:
    """Parameters from values (k,) and their standard uncertainties (k,)."""
    each = zip(names, value, std, units, strict=True)
    return tuple(EffectParameter(name, float(v), float(s), unit) for name, v, s, unit in each)


def per_axis(symbol: str) -> tuple[str, ...]:
    """Names of one parameter per axis."""
    return tuple(f"{symbol}_{axis}" for axis in AXES)


def per_axis_parameters(symbol: str, size: FloatArray, std: FloatArray, unit: str) -> tuple[EffectParameter, ...]:
    """One parameter per axis, from sizes (3,) and their standard uncertainties (3,)."""
    return measured(per_axis(symbol), size, std, (unit,) * 3)


def acting_on(sensor: int, columns: FloatArray) -> Distortion:
    """Columns (points, 3, k) that a sensor (0 accelerometer, 1 gyro) alone reads."""
    return Distortion(None, columns) if sensor else Distortion(columns, None)


def on_axes(
    context: Context, sensor: int, *parts: tuple[str, FloatArray, str],
    label: str = "", shape: dict[str, tuple[float, str]] | None = None, scale: float = 1.0,
) -> Variant:  # fmt: skip
    """What a sensor (0 accelerometer, 1 gyro) reads more along its axes: three parameters for each part, of a symbol,
    values (points, 3), or (points, 1) alike on all axes, and the parameters' unit."""
    columns = [context.on_axes(sensor, np.broadcast_to(one, (len(one), 3))) for _, one, _ in parts]
    whole = columns[0] if len(columns) == 1 else np.concatenate(columns, axis=2)
    names, units = zip(*((f"{symbol}_{axis}", unit) for symbol, _, unit in parts for axis in AXES), strict=True)
    return Variant(acting_on(sensor, whole), names, units, shape or {}, label, scale=scale)
