"""What the session model is given: hold means, moves and their noise, centred, in raw units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

LEFT_OUT = 1e6
"""Factor on standard errors of what is held out: it then says nothing, and the layout of the model stays."""


@dataclass(frozen=True, eq=False)
class Observed:
    """One session for the core, readings minus ``force_origin``, ``rate_origin`` (3,).

    Hold means and standard errors (n, 3), densities (3,) raw · √s, samples (N, 3), moves ``ranges`` (m, 2) with the
    holds ``before`` (m,) they begin in, ``unresolved`` (m, 2, 3) variances of their integrals; ``inflation`` on the
    standard errors of gravity after a move and of the velocity over it.
    """

    gravity_m_s2: float
    force_origin: FloatArray
    rate_origin: FloatArray
    hold_time_s: FloatArray
    hold_force: FloatArray
    hold_force_sigma: FloatArray
    force_density: FloatArray
    hold_rate: FloatArray
    hold_rate_sigma: FloatArray
    rate_density: FloatArray
    time_s: FloatArray
    force: FloatArray
    rate: FloatArray
    ranges: npt.NDArray[np.int64]
    before: npt.NDArray[np.int64]
    unresolved: FloatArray
    sigma_time_s: float
    nominal_step_s: float
    inflation: tuple[float, float] = (1.0, 1.0)

    def without(self, holds: BoolArray, moves: BoolArray) -> Observed:
        """The session with some holds' means and some moves saying nothing."""
        weaker = np.where(holds, LEFT_OUT, 1.0)[:, None]
        kept = ~moves
        return replace(
            self,
            hold_force_sigma=self.hold_force_sigma * weaker,
            ranges=np.ascontiguousarray(self.ranges[kept]),
            before=np.ascontiguousarray(self.before[kept]),
            unresolved=np.ascontiguousarray(self.unresolved[kept]),
        )

    @property
    def scatter_unit(self) -> FloatArray:
        """(2, 3) the scatter of zeros that strength one means: the median standard error of a hold, raw."""
        return np.stack([np.median(self.hold_force_sigma, axis=0), np.median(self.hold_rate_sigma, axis=0)])

    def model(self, scatter_unit: FloatArray | None = None) -> _core.SessionModel:
        """The Rust model."""
        return _core.SessionModel(
            gravity_m_s2=self.gravity_m_s2,
            hold_time_s=self.hold_time_s,
            hold_force=self.hold_force,
            hold_force_sigma=self.hold_force_sigma,
            force_density=self.force_density,
            hold_rate=self.hold_rate,
            hold_rate_sigma=self.hold_rate_sigma,
            rate_density=self.rate_density,
            time_s=self.time_s,
            force=self.force,
            rate=self.rate,
            ranges=self.ranges,
            before=self.before,
            unresolved=self.unresolved,
            jitter_s=self.sigma_time_s,
            nominal_step_s=self.nominal_step_s,
            inflation=self.inflation,
            prior=None,
            is_prior_weak=False,
            scatter=np.ascontiguousarray(self.scatter_unit if scatter_unit is None else scatter_unit),
        )


def arranged(
    recording: Recording, segments: Segments, measured: MoveMeasurements, gravity_m_s2: float, used: BoolArray
) -> Observed:
    """Arrange measured holds and the moves in use; neighbouring still samples bracket each move."""
    assert recording.accelerometer is not None
    assert segments.accelerometer_sigma is not None
    n = recording.n_samples
    force_origin, rate_origin = measured.reading.mean(axis=0), measured.zero_read.mean(axis=0)
    ranges, before, unresolved = [], [], []
    for (start, stop), (hold, after), is_used in zip(measured.edges, measured.links, used, strict=True):
        a, b = max(int(start) - 1, 0), min(int(stop) + 1, n)
        values = recording.accelerometer[a:b]
        if not is_used or after != hold + 1 or b - a < 3 or not np.isfinite(values).all():
            continue
        if not np.isfinite(measured.rate[a:b]).all():
            continue
        extra = np.zeros((2, 3))
        if measured.reading_variance is not None:
            extra[1] = measured.reading_variance[a:b].sum(axis=0) * measured.nominal_step_s**2
        ranges.append((a, b))
        before.append(hold)
        unresolved.append(extra)
    floor = 1e-12 * np.abs(measured.reading).max()
    return Observed(
        gravity_m_s2=gravity_m_s2,
        force_origin=force_origin,
        rate_origin=rate_origin,
        hold_time_s=np.ascontiguousarray(segments.time_mid_s, dtype=np.float64),
        hold_force=measured.reading - force_origin,
        hold_force_sigma=np.sqrt(np.maximum(measured.var_reading_noise, floor**2)),
        force_density=np.asarray(segments.accelerometer_sigma) * np.sqrt(1.0 / recording.rate_hz),
        hold_rate=measured.zero_read - rate_origin,
        hold_rate_sigma=np.sqrt(np.maximum(measured.var_zero_read, 1e-300)),
        rate_density=np.ascontiguousarray(measured.noise_density),
        time_s=np.ascontiguousarray(recording.time_s),
        force=np.ascontiguousarray(recording.accelerometer - force_origin),
        rate=np.ascontiguousarray(measured.rate - rate_origin),
        ranges=np.array(ranges, dtype=np.int64).reshape(-1, 2),
        before=np.array(before, dtype=np.int64),
        unresolved=np.array(unresolved).reshape(-1, 2, 3),
        sigma_time_s=measured.sigma_time_s,
        nominal_step_s=measured.nominal_step_s,
    )
