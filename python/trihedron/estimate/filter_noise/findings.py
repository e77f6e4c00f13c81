"""Findings on filter noise: N, K and their consistency, static values beside this log, tilt errors of its moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from trihedron.records import Finding
from trihedron.records.filter_noise import RANKED_S, SensorFilterNoise, StaticNoise, TiltCheck

CONSISTENT = (1.0, 9.0)
"""Acceptable NEES (3 expected, within a factor of three): outside, the covariance misleads a filter."""
UNCERTAIN = math.sqrt(CONSISTENT[1] / CONSISTENT[0])
"""Upper over lower end of N's interval whose every N leaves the NEES, which goes with N⁻², within those limits."""
FEWEST_MOVES = 3
"""Fewest moves whose tilt error is compared with its prediction."""
UNLIKE = 1.5
"""Ratio of two static N that is of no one part with one setting: from day to day it changes by 10 %, with temperature
by 30 %."""


def too_sure(tilt: TiltCheck | None) -> Iterator[Finding]:
    """A finding where tilt errors after moves exceed what static N predicts by more than a filter tolerates."""
    if tilt is None or tilt.n < FEWEST_MOVES or not tilt.predicted > 0.0 or tilt.actual <= UNCERTAIN * tilt.predicted:
        return
    times = tilt.actual / tilt.predicted
    yield Finding.of("filter-noise-inconsistent", "tilt", actual_rad=tilt.actual, times=times, n=tilt.n)


def unlike_this_log(
    static: Mapping[str, StaticNoise], own: Mapping[str, StaticNoise], sensors: Sequence[SensorFilterNoise], name: str
) -> Iterator[Finding]:
    """Findings where N of the static log ``name`` is unlike that of this log's rest, or exceeds the quietest second."""
    quietest: dict[str, float] = {one.sensor: one.quietest for one in sensors}
    for sensor, known in static.items():
        N, rest = known.N, own.get(sensor)
        if N.is_limit or (rest is not None and rest.N.is_limit):
            continue
        lower, upper = (0.0, quietest.get(sensor, 0.0)) if rest is None else (rest.N.lower, rest.N.upper)
        if upper > 0.0 and max(N.lower / upper, lower / N.upper) > UNLIKE:
            beside = upper if rest is None else rest.N.value
            yield Finding.of(
                "filter-noise-other-static",
                sensor=sensor,
                name=name,
                static=N.value,
                own=beside,
                times=N.value / beside,
                unit="rad/s" if sensor == "gyroscope" else "m/s^2",
                is_rest=rest is not None,
            )


def noticed(one: SensorFilterNoise) -> Iterator[Finding]:
    """Findings about N, K and their consistency of one sensor."""
    sensor, N, has_static = one.sensor, one.N, one.static is not None
    if not one.is_settled:
        yield Finding.of("filter-noise-unsettled", sensor=sensor)
    if N.is_limit and not has_static and N.upper <= one.quietest:
        yield Finding.of("filter-noise-below-quietest", sensor=sensor, quietest=one.quietest)
    elif N.is_limit:
        yield Finding.of("filter-noise-uncertain", "limit", upper=N.upper, sensor=sensor, has_static=has_static)
    elif N.upper > N.lower * UNCERTAIN:
        low, high = N.lower, N.upper
        yield Finding.of(
            "filter-noise-uncertain", sensor=sensor, in_file=N.value, lower=low, upper=high, has_static=has_static
        )
    elif (mostly := _mostly_reference(one)) is not None:
        share, at_s = mostly
        yield Finding.of(
            "filter-noise-uncertain", "reference", sensor=sensor, share=share, horizon_s=at_s, has_static=has_static
        )
    if not has_static:
        yield Finding.of("filter-noise-no-static", sensor=sensor)
    if one.reference is not None and one.reference.follows:
        yield Finding.of("filter-noise-followed", sensor=sensor)
    if one.reference is not None and (one.K.is_limit or one.reference.slow.is_limit):
        yield Finding.of("filter-noise-not-separated", sensor=sensor)
    if (uncalibrated := _uncalibrated(one)) is not None:
        yield Finding.of("filter-noise-uncalibrated", sensor=sensor, share=uncalibrated[0], horizon_s=uncalibrated[1])
    tested = [c for c in one.consistency if c.n_apart >= 3]
    worst = next((c for c in tested if not CONSISTENT[0] <= c.nees <= CONSISTENT[1]), None)
    if worst is not None:
        yield Finding.of("filter-noise-inconsistent", sensor=sensor, nees=worst.nees, horizon_s=worst.horizon_s)


def _mostly_reference(one: SensorFilterNoise) -> tuple[float, float] | None:
    """Share of the reference's own error and horizon [s], where it is so large that N and K off by ``UNCERTAIN`` change
    the whole error by less; over the horizon nearest ``RANKED_S``."""
    shares = [
        (abs(s.horizon_s - RANKED_S), s.share.filter_value, s.horizon_s) for s in one.shares if s.cause == "reference"
    ]
    _, share, horizon_s = min(shares, default=(0.0, 0.0, 0.0))
    return (share, horizon_s) if share > UNCERTAIN**2 * (1.0 - share) else None


def _uncalibrated(one: SensorFilterNoise) -> tuple[float, float] | None:
    """Share and horizon [s] where errors that a calibration removes exceed those of N and K (lower limit against upper
    limits); None where nowhere."""
    found: list[tuple[float, float]] = []
    for horizon_s in {share.horizon_s for share in one.shares}:
        at = {share.cause: share.share for share in one.shares if share.horizon_s == horizon_s}
        removed = sum(at[cause].lower for cause in ("calibration", "g-sensitivity", "temperature") if cause in at)
        if removed > sum(at[cause].upper for cause in ("static", "vibration", "bias") if cause in at):
            found.append((removed, horizon_s))
    return max(found, default=None)
