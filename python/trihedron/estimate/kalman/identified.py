"""From identified noise terms (Allan variance, docs/noise.md) to the noise that the filter takes, in raw units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from trihedron.records.kalman import AxisNoise
from trihedron.units import AccelerationUnit, acceleration_to_si


class IdentifiedProcess(Protocol):
    """A Gauss-Markov process that was seen as such."""

    @property
    def sigma_process(self) -> float:
        """Standard deviation."""

    @property
    def correlation_time_s(self) -> float:
        """Correlation time."""


class IdentifiedAxis(Protocol):
    """What is needed of an axis of identified noise; values in ``unit`` and seconds."""

    @property
    def name(self) -> str:
        """Name of the channel."""

    @property
    def unit(self) -> str:
        """Unit of the channel."""

    @property
    def sample_sigma(self) -> float:
        """Scatter of one sample."""

    @property
    def resolution(self) -> float:
        """Step of the converter."""

    @property
    def gauss_markov(self) -> IdentifiedProcess | None:
        """First-order process besides the five terms."""

    def fitted(self, symbol: str) -> float:
        """Share of Q, N, B, K or R in the most likely sum of terms."""


def noise_from_identified(
    axes: Sequence[IdentifiedAxis], raw_unit: AccelerationUnit | str
) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """Noise of the three accelerometer axes among the identified ones, in the raw unit of the log to be calibrated.

    The axes with a unit of acceleration are taken; where there is none (counts), the first three.

    Raises
    ------
    ValueError
        When there are not three such axes, or their unit cannot be turned into the raw unit.
    """
    units = {unit.value for unit in AccelerationUnit} - {AccelerationUnit.COUNTS.value}
    chosen = [axis for axis in axes if axis.unit in units] or list(axes[:3])
    if len(chosen) != 3:
        names = ", ".join(axis.name for axis in axes)
        raise ValueError(f"noise of three accelerometer axes is needed, and was identified for {names}")
    out = [_one(axis, AccelerationUnit(raw_unit)) for axis in chosen]
    return out[0], out[1], out[2]


def _one(axis: IdentifiedAxis, raw_unit: AccelerationUnit) -> AxisNoise:
    factor = 1.0
    if axis.unit != raw_unit.value:
        has = (
            acceleration_to_si(AccelerationUnit(axis.unit))
            if axis.unit in {unit.value for unit in AccelerationUnit}
            else None
        )
        wanted = acceleration_to_si(raw_unit)
        if has is None or wanted is None:
            raise ValueError(
                f"the noise of {axis.name} is in {axis.unit or 'an unknown unit'} and the log in {raw_unit.value}: "
                "identify the noise from a log in the same unit"
            )
        factor = has / wanted
    process = axis.gauss_markov
    noise = AxisNoise(
        quantisation=axis.fitted("Q"),
        white=axis.fitted("N"),
        flicker=axis.fitted("B"),
        walk=axis.fitted("K"),
        ramp=abs(axis.fitted("R")),
        gauss_markov=0.0 if process is None else process.sigma_process,
        gauss_markov_time_s=0.0 if process is None else process.correlation_time_s,
        resolution=axis.resolution,
        sample_sigma=axis.sample_sigma,
    )
    return noise.scaled(factor)
