"""Earth rate, which turns with the attitude."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from trihedron.arrays import FloatArray
from trihedron.defaults import FALSE_ALARM
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, acting_on
from trihedron.diagnose.session.starting_point import PUBLISHED_DIGITS
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.probability import chdtrc
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words
from trihedron.units import degrees_from_radians

N_GRID = 121
"""Latitudes and azimuths at which the likelihood is computed: 1.5° and 3°, then closer about the best,
until no angle is surer than a step."""
STATED = "stated_vertical"
"""Parameter of a log without Earth rate: the vertical component that the session model subtracts."""


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
    centre, half = np.zeros(2), np.array([np.pi / 2, np.pi])
    while True:
        latitude, azimuth = np.meshgrid(*(centre + half * np.linspace(-1.0, 1.0, N_GRID)[:, None]).T, indexing="ij")
        away = _turning(latitude, azimuth) - value
        chi2 = ((away @ precision) * away).sum(axis=-1)
        # Mean and spread of the likelihood within the hemisphere of the higher likelihood.
        weight = np.exp(-0.5 * (chi2 - chi2.min())) * np.maximum(np.cos(latitude), 0.0)
        weight *= (latitude > 0.0) == (weight[latitude > 0.0].sum() >= weight[latitude <= 0.0].sum())
        weight /= weight.sum()
        mean = float((weight * latitude).sum()), float(np.angle((weight * np.exp(1j * azimuth)).sum()))
        turned = np.angle(np.exp(1j * (azimuth - mean[1])))
        std = np.sqrt([(weight * (latitude - mean[0]) ** 2).sum(), (weight * turned**2).sum()])
        step = 2.0 * half / (N_GRID - 1)
        if (std > step).all():
            return Turning(*mean, float(std[0]), float(std[1]), float(chi2.min()))
        best = np.unravel_index(int(weight.argmax()), weight.shape)
        centre = np.where(std > step, centre, [latitude[best], azimuth[best]])
        half = np.where(std > step, half, 0.5 * half)


def _turning(latitude: FloatArray, azimuth: FloatArray) -> FloatArray:
    """(..., 3) Earth rate [rad/s] in a level frame whose x lies ``azimuth`` from north."""
    level = np.cos(latitude)
    unit = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(latitude)], axis=-1)
    return np.asarray(unit * EARTH_RATE_RAD_S)


def _nearest(variant: Variant, value: FloatArray, covariance: FloatArray) -> Turning:
    """The nearest Earth rate to the fitted components, with the vertical one where the latitude states it."""
    known = [up for up, _ in variant.shape.values()]
    exact = np.full(len(known), (PUBLISHED_DIGITS * EARTH_RATE_RAD_S) ** 2)
    return nearest_turning(np.append(value, known), block_diag(covariance, np.diag(exact)))


class EarthRate(Effect):
    """Earth rate in the level frame of the first pose: two horizontal components and the vertical one.

    At a stated latitude the session model contains the vertical one already.
    """

    id = "earth-rate"
    needs_moves = True
    of_session = ("latitude", "north_azimuth", "horizontal_x", "horizontal_y")
    size = EARTH_RATE_RAD_S
    """rad/s: the size is known."""

    def variants(self, context: Context) -> list[Variant]:
        columns = np.where(np.isfinite(context.attitude), context.attitude, 0.0)
        known = context.obs.earth_up_rad_s
        names, units = ("horizontal_x", "horizontal_y", "vertical"), ("rad/s",) * 3
        if not known:
            return [Variant(acting_on(1, columns), names, units)]
        # Not all gyros read it: those of a simulation, or those whose bias is removed where they are static.
        return [
            Variant(acting_on(1, columns[:, :, :2]), names[:2], units[:2], {"vertical": (known, "rad/s")}),
            Variant(acting_on(1, columns[:, :, 2:]), names[2:], units[2:], {STATED: (known, "rad/s")}, label="absent"),
        ]

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        # The length of Earth rate is known: any other vector is another effect.
        if STATED in variant.shape:
            chi2 = float((value[0] + variant.shape[STATED][0]) ** 2 / covariance[0, 0])
        else:
            chi2 = _nearest(variant, value, covariance).chi2
        return chdtrc(1, chi2) > FALSE_ALARM

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        own = super().parameters(variant, value, covariance)
        if STATED in variant.shape:
            return own
        near = _nearest(variant, value, covariance)
        angles = (("latitude", near.latitude, near.latitude_std), ("north_azimuth", near.azimuth, near.azimuth_std))
        return (
            *(EffectParameter(n, degrees_from_radians(v), degrees_from_radians(s), "deg") for n, v, s in angles),
            *own,
        )

    def statement(self, parameters: tuple[EffectParameter, ...]) -> Words:
        by_name = {p.name: p for p in parameters}
        if STATED in by_name:
            return self.reported("absent", vertical=by_name["vertical"].value, stated=by_name[STATED].value)
        at, heading = by_name["latitude"], by_name["north_azimuth"]
        return self.reported(
            "latitude", latitude_deg=at.value, latitude_std_deg=at.std, azimuth_deg=heading.value,
            azimuth_std_deg=heading.std,
        )  # fmt: skip
