"""A scale that all gyro axes share and the log's unit excludes: another unit, rate or time base."""

from collections.abc import Iterable, Iterator

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.findings import WEAK
from trihedron.probability import stdtrit
from trihedron.records import Finding, Recording
from trihedron.units import RateUnit, rate_to_si

MAX_SCALE_RATIO = 1.25
"""Ratio to the nominal scale above which the unit or the rate is wrong: MEMS gyros are within 10 % of data sheets."""
BEYOND = 3.0
"""Standard errors from the nominal scale below which moves contradict no unit: they hardly determine it."""
ONE_FACTOR = 0.01
"""Probability that three scales which differ from axis to axis by chance look like one factor."""


def scale_findings(S: FloatArray, sigma: float, recording: Recording) -> Iterator[Finding]:
    """Finding for a common scale that contradicts the unit of the log: unit, sampling rate or timestamps are wrong.
    ``sigma`` is its relative standard error."""
    raw_unit = recording.gyroscope_unit
    nominal = rate_to_si(raw_unit)
    if nominal is None:
        return
    each = np.log(np.linalg.norm(S, axis=0) / nominal)
    common, spread = float(np.mean(each)), float(np.std(each, ddof=1))
    if not abs(common) > BEYOND * sigma:
        return
    if abs(common) > np.log(MAX_SCALE_RATIO):
        ratios = {one: nominal * np.exp(common) / si for one in RateUnit if (si := rate_to_si(one))}
        fitting = min(ratios, key=lambda one: abs(np.log(ratios[one])))
        has_fitting = bool(abs(np.log(ratios[fitting])) < np.log(MAX_SCALE_RATIO))
        yield Finding.of(
            "scale-not-nominal",
            "gyro",
            scale_ratio=np.exp(common),
            unit=raw_unit.value,
            has_fitting=has_fitting,
            fitting=fitting.value if has_fitting else "",
            right_hz=recording.rate_hz / np.exp(common),
        )
    # Sensitivities differ from axis to axis; what all three have in common and data sheets exclude may be the time.
    elif abs(common) > WEAK and abs(common) > -stdtrit(2, ONE_FACTOR / 2.0) * spread / np.sqrt(3.0):
        yield Finding.of(
            "scale-not-nominal",
            "gyro-common",
            excess=np.expm1(common),
            spread=spread,
            nominal=WEAK,
            unit=raw_unit.value,
        )


def without_first_scale(findings: Iterable[Finding], fitted: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings without the reader's estimate of a scale that the fit found again, more exactly."""
    is_fitted = any(one.code == "scale-not-nominal" and "right_hz" in one.numbers for one in fitted)
    is_first = ("unit-contradicted", True)
    return tuple(one for one in findings if not (is_fitted and (one.code, "right_hz" in one.numbers) == is_first))
