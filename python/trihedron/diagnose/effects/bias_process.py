"""Random changes of a bias from pose to pose: a strength of the session's noise, not columns of the readings."""

from abc import abstractmethod
from typing import ClassVar

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import GYRO, SENSORS, Effect
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words, why_not

FEWEST_POSES = 6
"""Fewer poses do not separate two processes on three axes."""


class BiasProcess(Effect):
    """A bias random walk or scatter beyond what the part's noise explains (:mod:`diagnose.bias_strengths`)."""

    sensor: ClassVar[int]
    """0 accelerometer, 1 gyro."""
    walks: ClassVar[bool]
    """Whether the bias walks from pose to pose; otherwise it is drawn anew in each."""

    @property
    def unit(self) -> str:
        """SI unit of the bias."""
        return SENSORS[self.sensor].unit

    def unavailable(self, context: Context) -> str | None:
        if self.sensor == GYRO and context.obs.raw_rate is None:
            return why_not("no-gyro")
        return why_not("six-poses") if context.obs.n_poses < FEWEST_POSES else None

    @abstractmethod
    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        """Parameters and sentence for the size along every axis, SI (3,), with standard uncertainties."""


def per_axis_parameters(symbol: str, size: FloatArray, std: FloatArray, unit: str) -> tuple[EffectParameter, ...]:
    """One parameter per axis."""
    named = zip(AXES, size, std, strict=True)
    return tuple(EffectParameter(f"{symbol}_{axis}", float(v), float(s), unit) for axis, v, s in named)
