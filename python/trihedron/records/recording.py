"""A recording: raw readings of one IMU on one time base, as they were logged."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.answers import ask
from trihedron.arrays import AXES, CORE_MEMORY, FloatArray
from trihedron.errors import InputError
from trihedron.records.channel_facts import Limit, LowPass, RecordingFacts
from trihedron.records.checked import Checked, numbers_of
from trihedron.records.finding import Finding
from trihedron.records.onboard import Onboard
from trihedron.records.presented import Presented
from trihedron.records.sampling import UNJUDGED, Sampling
from trihedron.sanitise import one_line
from trihedron.units import AccelerationUnit, RateUnit


def _is_frozen(array: object) -> bool:
    """Whether an array is read-only, and every array that it is a view of."""
    while isinstance(array, np.ndarray) and not array.flags.writeable:
        array = array.base
    return array is None or isinstance(array, CORE_MEMORY)


def _readonly(array: npt.ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    # A read-only array is shared, not copied: a log of 1e8 rows must not exist twice.
    array = numbers_of(name, array)
    frozen = _is_frozen(array)
    out: FloatArray = np.array(array, dtype=np.float64, order="C", copy=None if frozen else True)
    if out.ndim != len(shape) or any(
        want is not None and got != want for got, want in zip(out.shape, shape, strict=True)
    ):
        wanted = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name} must have shape {wanted}, got {out.shape}")
    out.setflags(write=False)
    return out


def spread_timestamps(time_s: FloatArray, step_s: float) -> FloatArray:
    """Strictly increasing timestamps (n,) from non-decreasing ones: repeated timestamps are spread evenly to one side.

    Samples that were timestamped on arrival in a batch were taken in the long step before their timestamp; for
    timestamps that were truncated to few digits, or repeated, the long step is after it. The side with the larger sum
    of steps in the whole log is used; no two samples are put further apart than ``step_s``.
    """
    if np.all(np.diff(time_s) > 0):
        return time_s
    first = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > 0)
    size = np.diff(first, append=len(time_s))
    timestamp = time_s[first]
    before = np.diff(timestamp, prepend=timestamp[0] - step_s * size[0])
    after = np.diff(timestamp, append=timestamp[-1] + step_s * size[-1])
    shared = size > 1
    inner = shared & (np.arange(len(size)) > 0) & (np.arange(len(size)) < len(size) - 1)
    is_before = before[inner].sum() >= after[inner].sum()
    apart = np.minimum((before if is_before else after) / size, step_s)
    within = np.arange(len(time_s)) - np.repeat(first, size)
    place = within - (np.repeat(size, size) - 1 if is_before else 0)
    out = np.repeat(timestamp, size) + place * np.repeat(apart, size)
    out = np.asarray(out - out[0], dtype=np.float64)
    # Neighbouring floats cannot be subdivided: such timestamps advance by the smallest float step.
    for k in np.flatnonzero(np.diff(out) <= 0):
        out[k + 1] = np.nextafter(out[k], np.inf)
    return out


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Checked, Presented):
    """Raw readings on a common time base.

    Parameters
    ----------
    time_s : (n,)
        Seconds since the first sample, non-decreasing: the timestamps, or the even clock behind them where ``sampling``
        says so. Gaps are kept.
    accelerometer, gyroscope : (n, 3) or None
        Raw readings in ``accelerometer_unit`` / ``gyroscope_unit``. At least one sensor is present. A missing
        reading is NaN; stages skip it.
    rate_hz : float
        Sampling rate: samples per second outside gaps (a median step is biased by timestamps rounded to a
        millisecond).
    temperature_degc, supply_v : (n,) or None
        Auxiliary channels where the log has them.
    source, sha256 : str
        Name of the source for display; hash of the bytes that were read (of the arrays when made in memory).
    start_epoch_s : float
        Unix time of the first sample where the log has it, else 0.
    latitude_deg : float or None
        Latitude of the place, once it is stated: the gyro reads the Earth's rotation about the vertical.
    findings : tuple of Finding
        Findings of the audit of the log.
    sampling : Sampling
        Kind and error of the timestamps, as determined when the log was read.
    auxiliary : mapping of name to (n,) array
        Every other numeric column, untouched.
    onboard : Onboard, optional
        Corrections that a flight controller applied before it logged the readings, where the log states them.
    rows_in_file, rows_read : int
        Rows in the file (or both files), and rows that became readings; the others are in findings, so that
        ``rows_in_file == rows_read + rows_reported``. 0 where no file was read.

    Raises
    ------
    ValueError
        When shapes disagree or time runs backward.

    Examples
    --------
    >>> static = trihedron.Recording(np.arange(200) / 100.0, np.tile([0.0, 0.0, 9.81], (200, 1)), None, 100.0)
    >>> static.n_samples, static.duration_s
    (200, 2.0)
    """

    time_s: FloatArray
    accelerometer: FloatArray | None
    gyroscope: FloatArray | None
    rate_hz: float
    accelerometer_unit: AccelerationUnit = AccelerationUnit.M_S2
    gyroscope_unit: RateUnit = RateUnit.RAD_S
    temperature_degc: FloatArray | None = None
    supply_v: FloatArray | None = None
    start_epoch_s: float = 0.0
    source: str = "memory"
    sha256: str = ""
    findings: tuple[Finding, ...] = ()
    sampling: Sampling = UNJUDGED
    auxiliary: MappingProxyType[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    onboard: Onboard | None = None
    rows_in_file: int = 0
    rows_read: int = 0
    latitude_deg: float | None = None

    def __post_init__(self) -> None:
        time_s = _readonly(self.time_s, "time_s", (None,))
        n = len(time_s)
        if n == 0:
            raise InputError("a recording needs at least one sample")
        # A non-decreasing sequence between finite ends has no NaN and no infinity.
        if not (np.isfinite(time_s[0]) and np.isfinite(time_s[-1]) and np.all(time_s[1:] >= time_s[:-1])):
            raise InputError("time_s must be finite and non-decreasing")
        object.__setattr__(self, "time_s", time_s)
        if self.accelerometer is None and self.gyroscope is None:
            raise InputError("a recording needs an accelerometer or a gyroscope")
        for name in ("accelerometer", "gyroscope"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _readonly(value, name, (n, 3)))
        for name in ("temperature_degc", "supply_v"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _readonly(value, name, (n,)))
        super().__post_init__()
        if self.rate_hz <= 0.0:
            raise InputError(f"rate_hz must be a positive number, got {self.rate_hz}")
        if self.latitude_deg is not None and abs(self.latitude_deg) > 90.0:
            raise InputError(f"latitude_deg must be between -90 and 90, got {self.latitude_deg}")

    def with_distinct_timestamps(self) -> Recording:
        """This recording with strictly increasing timestamps (:func:`spread_timestamps`)."""
        distinct = spread_timestamps(self.time_s, 1.0 / self.rate_hz)
        return self if distinct is self.time_s else self.with_same_readings(time_s=distinct)

    def with_facts(self, facts: RecordingFacts) -> Recording:
        """This recording with the channel properties that its reader has measured."""
        self.__dict__["facts"] = facts
        return self

    def with_same_readings(self, **changes: Any) -> Recording:
        """This recording with fields other than the readings changed; measured channel properties are kept."""
        changed = replace(self, **changes)
        return changed.with_facts(self.facts) if "facts" in self.__dict__ else changed

    @classmethod
    def from_arrays(
        cls,
        time_s: npt.ArrayLike | None,
        accelerometer: npt.ArrayLike | None = None,
        gyroscope: npt.ArrayLike | None = None,
        *,
        accelerometer_unit: str | AccelerationUnit = AccelerationUnit.M_S2,
        gyroscope_unit: str | RateUnit = RateUnit.RAD_S,
        rate_hz: float | None = None,
        temperature_degc: npt.ArrayLike | None = None,
        supply_v: npt.ArrayLike | None = None,
    ) -> Recording:
        """An audited recording of arrays: ``time_s`` (n,) [s] or None with ``rate_hz``, readings (n, 3) in their units.

        Masked and NaN readings are missing; their rows are kept. The audit is the same as for a file.

        Raises
        ------
        ValueError
            When shapes disagree, or neither ``time_s`` nor ``rate_hz`` is given.
        """
        # The audit is in the reader; users look for the constructor here.
        audited: Recording = ask(
            "of_arrays",
            time_s,
            accelerometer,
            gyroscope,
            accelerometer_unit=accelerometer_unit,
            gyroscope_unit=gyroscope_unit,
            rate_hz=rate_hz,
            temperature_degc=temperature_degc,
            supply_v=supply_v,
        )
        return audited

    @cached_property
    def facts(self) -> RecordingFacts:
        """Properties of the ADCs, measured from the readings on first use."""
        # ``read`` measures them; a record only stores them.
        found: RecordingFacts = ask("facts_of", self._readings(), self.rate_hz)
        return found

    @cached_property
    def possible_limits(self) -> dict[str, tuple[Limit, ...]]:
        """Possible range limits by sensor, blurred by noise, on sides where ``facts`` has no exact code; found on
        demand. A steady turn at one rate looks the same, so they are not certain."""
        found: dict[str, tuple[Limit, ...]] = ask("find_possible_limits", self._readings(), self.facts)
        return found

    @cached_property
    def low_passes(self) -> dict[str, tuple[LowPass, ...]]:
        """The low-pass filter of each channel by sensor, from the noise in the quietest intervals; found on first
        use; empty for a sensor that is never static for 32 readings."""
        found: dict[str, tuple[LowPass, ...]] = ask("find_low_passes", self._readings(), self.rate_hz)
        return found

    def _readings(self) -> dict[str, FloatArray]:
        """Readings (n, 3) of the sensors present, by name."""
        named = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}
        return {name: one for name, one in named.items() if one is not None}

    @property
    def n_samples(self) -> int:
        """Number of rows."""
        return len(self.time_s)

    @property
    def rows_reported(self) -> int:
        """Rows of the file that are reported in findings and not among the readings."""
        return round(sum(finding.numbers.get("rows_left_out", 0.0) for finding in self.findings))

    def mapping_with(self, sensor: str, order: Sequence[int]) -> str:
        """The ``--columns`` that reads axis k of a sensor (``a``, ``g``) as its axis ``order[k]``; empty where the log
        is not one file with known columns."""
        stated = [dict(f.numbers) for f in self.findings if f.code == "columns-recognised"]
        if len(stated) != 1 or not stated[0]:
            return ""
        moved = {f"{sensor}{AXES[to]}": stated[0].get(f"{sensor}{axis}") for axis, to in zip(AXES, order, strict=True)}
        return ",".join(f"{role}={moved.get(role, column):.0f}" for role, column in stated[0].items())

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample, plus one sample step."""
        return float(self.time_s[-1] - self.time_s[0]) + 1.0 / self.rate_hz

    def __repr__(self) -> str:
        sensors = " + ".join(
            f"{name} [{unit.value}]"
            for name, value, unit in (
                ("accelerometer", self.accelerometer, self.accelerometer_unit),
                ("gyroscope", self.gyroscope, self.gyroscope_unit),
            )
            if value is not None
        )
        size = f"{self.n_samples} samples, {self.duration_s:.1f} s at {self.rate_hz:.4g} Hz"
        return f"<Recording {one_line(self.source)}: {size}, {sensors}>"


def as_arguments(source: str) -> str:
    """A recording as arguments of a command: a log, a device of an archive, or the files of accelerometer and gyro."""
    source, of_archive, device = source.partition(", device ")
    files = [shlex.quote(part) for part in source.split(" + ")]
    log = f"--accel {files[0]} --gyro {files[1]}" if len(files) == 2 else files[0]
    return f"{log} --instance {device}" if of_archive else log


def distinct_names(sources: Sequence[str]) -> list[str]:
    """Short distinct names of recordings; a log of two files has both names."""
    short = [" + ".join(Path(part).name or part for part in source.split(" + ")) for source in sources]
    return [name if short.count(name) == 1 else source for name, source in zip(short, sources, strict=True)]
