"""Several calibrations of one unit, judged on one recording and put in order."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import rms_of
from trihedron.records.presented import Printed
from trihedron.records.verification import Verification

Interval = tuple[float, float]


@dataclass(frozen=True)
class Suspicion:
    """A likely mistake in a calibration, which fits once it is corrected: ``kind`` from the list in ``report/``.

    ``rms`` and ``rms_undone`` are the errors before and after: gravity error in static poses [m/s²], tilt error after
    rotations [deg] or rate in static poses [rad/s]; ``factor`` is that of a wrong gravity or unit.
    """

    kind: str
    rms: float
    rms_undone: float
    factor: float = 1.0


@dataclass(frozen=True)
class Ranked:
    """One calibration: ``behind`` is its deficit in log predictive density to the best, with ``behind_sigma``.

    Intervals are of 95 % (bootstrap of poses and moves): gravity error in static poses [m/s²], tilt error after a
    rotation [deg]. ``without_bias`` names sensors whose bias the file lacks; the bias of this log replaces it.
    """

    name: str
    maker: str
    verification: Verification
    behind: float
    behind_sigma: float
    norm_interval: Interval
    angle_interval: Interval
    suspicions: tuple[Suspicion, ...] = ()
    without_bias: tuple[str, ...] = ()

    @property
    def is_rejected(self) -> bool:
        """A mistake is suspected, or a finding rejects it on this recording."""
        return bool(self.suspicions) or not self.verification.is_passed

    @property
    def is_clearly_behind(self) -> bool:
        """The best is more than 2 σ better."""
        return self.behind > 2.0 * self.behind_sigma

    @property
    def static_rate_rms(self) -> float:
        """Calibrated rate in static poses [rad/s]: rms over the axes of the mean over poses; NaN without a gyro."""
        rest = self.verification.static_rate
        return rms_of(np.mean(rest, axis=0)) if len(rest) else float("nan")


@dataclass(frozen=True, eq=False, repr=False)
class Ranking(Printed):
    """Calibrations in order, the best first. ``print`` gives the table."""

    source: str
    gravity_m_s2: float
    gravity_source: str
    candidates: tuple[Ranked, ...]

    @property
    def best(self) -> Ranked:
        """The first."""
        return self.candidates[0]

    def __repr__(self) -> str:
        return f"<Ranking of {len(self.candidates)} calibrations on {self.source}: {self.best.name} first>"
