"""Earth rate, which turns with the attitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, rate_only
from trihedron.gravity import EARTH_RATE_RAD_S, normal_gravity
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words
from trihedron.units import degrees_from_radians, radians_from_degrees

STEPS = 91, 180
"""Grid of latitudes and azimuths for the likelihood: two degrees each."""
N_STEPS, FINE = 10, np.pi / 90.0
"""Gauss-Newton steps from the best grid point, at most two degrees each; below σ = 4° angles are normal."""
MISSES = 6.63
"""χ² of the vector's length, one degree of freedom, p = 0.01: above it the vector is not Earth rate."""
NOMINAL = (9.8, 9.80665, 9.807, 9.81)
"""Nominal values of gravity, which give no information on the latitude."""
HEIGHTS_M, GRAVITY_SLACK = (-430.0, 5000.0), 0.005
"""Heights where sensors are calibrated, m, and deviation of gravity from normal gravity, rounding included, m/s²."""
OUTSIDE = 3.0
"""Standard uncertainties by which a latitude may lie outside the range that gravity allows."""


@dataclass(frozen=True)
class Turning:
    """Earth rate nearest to a measured vector: angles and their standard uncertainties [rad], χ² of the difference."""

    latitude: float
    azimuth: float
    latitude_std: float
    azimuth_std: float
    chi2: float


def nearest_turning(value: FloatArray, covariance: FloatArray) -> Turning:
    """The vector of Earth rate's length nearest to ``value`` (3,) rad/s in the metric of its covariance.

    The vertical part of a free vector is confounded with an isotropic g-sensitivity. The known length of Earth rate
    determines it from the horizontal part, except for its sign.
    """
    precision = np.linalg.pinv(covariance, hermitian=True)
    latitude, azimuth = np.meshgrid(
        np.linspace(-np.pi / 2, np.pi / 2, STEPS[0]),
        np.linspace(-np.pi, np.pi, STEPS[1], endpoint=False),
        indexing="ij",
    )
    away = _turning(latitude, azimuth) - value
    chi2 = ((away @ precision) * away).sum(axis=-1)
    start = np.unravel_index(int(np.argmin(chi2)), chi2.shape)
    at = np.array([latitude[start], azimuth[start]])
    for _ in range(N_STEPS):
        level, turn = at
        J = EARTH_RATE_RAD_S * np.array([
            [-np.sin(level) * np.cos(turn), -np.cos(level) * np.sin(turn)],
            [-np.sin(level) * np.sin(turn), np.cos(level) * np.cos(turn)],
            [np.cos(level), 0.0],
        ])  # fmt: skip
        spread = np.linalg.pinv(J.T @ precision @ J, hermitian=True)
        at = at - np.clip(spread @ J.T @ precision @ (_turning(*at) - value), -FINE, FINE)
    last = _turning(*at) - value
    std = np.sqrt(np.diag(spread))
    best = float(min(last @ precision @ last, chi2.min()))
    if std.max() < 2.0 * FINE:
        return Turning(float(at[0]), float(at[1]), float(std[0]), float(std[1]), best)
    # Not normal: mean and spread of the likelihood within the hemisphere of the higher likelihood.
    weight = np.exp(-0.5 * (chi2 - chi2.min())) * np.cos(latitude)
    weight *= (latitude > 0.0) == (weight[latitude > 0.0].sum() >= weight[latitude < 0.0].sum())
    weight /= weight.sum()
    level = float((weight * latitude).sum())
    heading = float(np.angle((weight * np.exp(1j * azimuth)).sum()))
    turned = np.angle(np.exp(1j * (azimuth - heading)))
    return Turning(
        level, heading, float(np.sqrt((weight * (latitude - level) ** 2).sum())),
        float(np.sqrt((weight * turned**2).sum())), best,
    )  # fmt: skip


def _turning(latitude: FloatArray, azimuth: FloatArray) -> FloatArray:
    """(..., 3) Earth rate [rad/s] in a level frame whose x lies ``azimuth`` from north."""
    level = np.cos(latitude)
    unit = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(latitude)], axis=-1)
    return np.asarray(unit * EARTH_RATE_RAD_S)


def latitudes_of(gravity: float) -> tuple[float, float]:
    """Least and greatest absolute latitude, rad, at which gravity has this value at any height of ``HEIGHTS_M``."""
    low, high = HEIGHTS_M
    if not np.isclose(gravity, NOMINAL, rtol=0.0, atol=1e-9).any():
        possible = [
            degree for degree in range(91)
            if normal_gravity(degree, high) - GRAVITY_SLACK <= gravity <= normal_gravity(degree, low) + GRAVITY_SLACK
        ]  # fmt: skip
        if possible:
            return radians_from_degrees(possible[0]), radians_from_degrees(possible[-1])
    return 0.0, 0.5 * np.pi


class EarthRate(Effect):
    """Earth rate in the level frame of the first pose: two horizontal components and the vertical one."""

    id = "earth-rate"
    needs_moves = True
    size = EARTH_RATE_RAD_S
    """rad/s: the size is known."""

    def variants(self, context: Context) -> list[Variant]:
        attitude = context.pose_attitude
        attitude = np.where(np.isfinite(attitude), attitude, 0.0)
        return [
            Variant(
                rate_only(context.between_poses(attitude)), ("horizontal_x", "horizontal_y", "vertical"),
                ("rad/s",) * 3, given={"gravity": context.fitted.state.gravity},
            )
        ]  # fmt: skip

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        # The length of Earth rate is known and gravity limits the latitude: any other vector is another effect.
        near = nearest_turning(value, covariance)
        least, most = latitudes_of(variant.given["gravity"])
        outside = max(least - abs(near.latitude), abs(near.latitude) - most)
        return near.chi2 < MISSES and outside < OUTSIDE * near.latitude_std

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        near = nearest_turning(value, covariance)
        angles = (("latitude", near.latitude, near.latitude_std), ("north_azimuth", near.azimuth, near.azimuth_std))
        return (
            *(EffectParameter(n, degrees_from_radians(v), degrees_from_radians(s), "deg") for n, v, s in angles),
            *super().parameters(variant, value, covariance),
        )

    def statement(self, parameters: tuple[EffectParameter, ...]) -> Words:
        by_name = {p.name: p for p in parameters}
        at, heading = by_name["latitude"], by_name["north_azimuth"]
        return self.reported(
            "latitude", latitude_deg=at.value, latitude_std_deg=at.std, azimuth_deg=heading.value,
            azimuth_std_deg=heading.std,
        )  # fmt: skip
