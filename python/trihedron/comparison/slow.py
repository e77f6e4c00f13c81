"""Bias instability and random walk of a given simulation against the recording's, by the biases in their poses."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.channel_facts.pooled import ratio_of
from trihedron.comparison.effects import FREE_CURVES
from trihedron.comparison.noise import Sampled
from trihedron.comparison.rows import NAMES, SENSORS, UNIT, Sensor, measured_row, remarked
from trihedron.estimate.noise.slow import PoseBiases, SlowDifference, compare_slow, correlation_time
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import Diagnosis, NoiseDifference, NoiseTerm
from trihedron.records.domains import Domain
from trihedron.records.pose_noise import Measured
from trihedron.records.words import Words, words
from trihedron.segment import resegment
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of

TESTS = 48.0
"""Divisor of alpha: a half goes to parameters, three eighths to noise, a twelfth to slow noise, for two sensors."""
LEAST_TIME_RATIO = 2.0
"""Correlation times of parts of one reel differ by half; makers state none."""
ALIKE = 1.25
"""Two sensors of one part whose correlation times agree within a quarter have one common time."""


def correlation_times(model: Sampled, recording: Sampled, *, alpha: float) -> tuple[NoiseDifference, ...]:
    """A row for each sensor with a correlation time in the poses of both logs; one time used for both is named."""
    times = {
        sensor: (correlation_time(model.noise[sensor]), correlation_time(recording.noise[sensor]))
        for sensor in SENSORS
        if sensor in model.noise and sensor in recording.noise
    }
    both = {sensor: (m, r) for sensor, (m, r) in times.items() if m is not None and r is not None}
    is_one = _is_one_for_both(both, alpha)
    out = []
    for sensor, (m, r) in both.items():
        row = measured_row(sensor, "", "correlation-time", (m, r), "s", LEAST_TIME_RATIO, alpha / TESTS)
        if is_one:
            (m_a, r_a), (m_g, r_g) = both["accelerometer"], both["gyroscope"]
            seen = {"accelerometer_s": r_a.value, "gyroscope_s": r_g.value}
            out.append(remarked(row, "one-time-for-both", model_s=math.sqrt(m_a.value * m_g.value), **seen))
        else:
            out.append(remarked(row, "time-ratio", sensor=NAMES[sensor], model_s=m.value, recording_s=r.value))
    return tuple(out)


def _is_one_for_both(both: Mapping[Sensor, tuple[Measured, Measured]], alpha: float) -> bool:
    """Whether a simulation has one time for both sensors where the recording's differ."""
    if len(both) < len(SENSORS):
        return False
    (m_a, r_a), (m_g, r_g) = (both[sensor] for sensor in SENSORS)
    model, recording = ratio_of(m_a, m_g), ratio_of(r_a, r_g)
    is_one = model.lower <= 1.0 <= model.upper and max(model.value, 1.0 / model.value) < ALIKE
    differ = recording.p_value < alpha / TESTS and max(recording.value, 1.0 / recording.value) > LEAST_TIME_RATIO
    return is_one and differ


LEAST_SLOW_RATIO = 2.0
"""Bias instability differs by half between parts of a reel and from day to day; makers state no spread."""
RESEMBLES_SLOW = 1.5
"""A session determines a walk to some 30 %: a ratio this near to the root of the rate is identified with it."""
OF_ALPHA = 24.0
"""Divisor of alpha: a twelfth is used for slow noise, half of it for either sensor."""
NO_SHAPE = frozenset({"gyro-bias-repeatability", "accel-bias-repeatability", "disturbed-pose", "periodic-interference"})
"""Effects that do not change the course of a bias from pose to pose."""
DOMAINS: Mapping[str, Domain] = MappingProxyType({"gyroscope": "static-gyro", "accelerometer": "static-accel"})
Side = tuple[Diagnosis, Recording, Segments]


def slow_noise(model: Side, recording: Side, *, alpha: float) -> tuple[NoiseDifference, ...]:
    """B and K of both sensors where both logs have enough poses.

    For the gyro from the biases of poses, axis by axis; for the accelerometer from their part along gravity, for all
    axes together. Significant where the
    p-value is below ``alpha``/24 and the ratio beyond a factor of two; never where a drift of the recording was named
    as an effect, or disagrees without one: a walk would then describe the same drift twice.
    """
    out: list[NoiseDifference] = []
    for sensor in reversed(SENSORS):
        # A free curve through a simulation's biases is its walk and no mechanism. A recording's may be one.
        has_curve = _has_curve(model[0], sensor)
        both = _biases(sensor, *model, with_curve=True), _biases(sensor, *recording, with_curve=has_curve)
        if both[0] and both[1]:
            is_open = _drifts(recording[0], sensor, but_curve=has_curve)
            out += _rows(sensor, compare_slow(*both), model[1].rate_hz, alpha, is_open=is_open)
    return tuple(out)


def _rows(
    sensor: Sensor, found: SlowDifference | None, rate_hz: float, alpha: float, *, is_open: bool
) -> list[NoiseDifference]:
    if found is None:
        return []
    common = math.exp(float(np.mean([math.log(r[found.term].value) for r in found.ratio])))
    differs = not is_open and found.p_value < alpha / OF_ALPHA and max(common, 1.0 / common) > LEAST_SLOW_RATIO
    out = []
    terms: tuple[NoiseTerm, NoiseTerm] = ("B", "K")
    axes = AXES if len(found.ratio) == len(AXES) else ("",)
    for term in terms:
        unit = UNIT[sensor] + ("" if term == "B" else "/sqrt(s)")
        is_it = differs and term == found.term
        remark = _remark(sensor, found, common, rate_hz) if is_it else ""
        for axis, of_m, of_r, ratios in zip(axes, found.first, found.second, found.ratio, strict=True):
            m, r, ratio = of_m[term], of_r[term], ratios[term]
            is_shown = m.lower > 0.0 and r.lower > 0.0
            out.append(
                NoiseDifference(
                    sensor, axis, term, m.value, r.value, ratio.value if is_shown or is_it else None,
                    (ratio.lower, ratio.upper) if is_shown or is_it else None, unit, found.p_value, is_it,
                    remark or ("" if is_shown else _unseen(term, m, r)),
                )
            )  # fmt: skip
    return out


def _drifts(found: Diagnosis, sensor: Sensor, *, but_curve: bool = False) -> bool:
    """Whether an effect explains the bias changes of a recording's sensor, or these disagree without one.

    ``but_curve``: a free curve through them counts as a walk, like that of the other side.
    """
    domain = DOMAINS[sensor]
    if any(test.disagrees for test in found.remaining if test.domain == domain):
        return True
    named = any(h.domain == domain for e in found.effects if e.id not in NO_SHAPE for h in e.held_out[:1])
    return named and not (but_curve and _has_curve(found, sensor))


def _has_curve(found: Diagnosis, sensor: Sensor) -> bool:
    """Whether the only effect on a sensor's biases, beside their scatter, is a drift along a free curve."""
    domain, drift = DOMAINS[sensor], f"{'gyro' if sensor == 'gyroscope' else 'accel'}-bias-drift"
    of_biases = [e for e in found.effects if any(h.domain == domain for h in e.held_out) and e.id not in NO_SHAPE]
    return len(of_biases) == 1 and of_biases[0].id == drift and of_biases[0].model.get("variant") in FREE_CURVES


def _biases(
    sensor: Sensor, found: Diagnosis, recording: Recording, segments: Segments, *, with_curve: bool
) -> tuple[PoseBiases, ...]:
    """Biases of a session's poses, the effects on them compensated: the gyro's per axis, or the norms of gravity with
    their directions; none without the sensor.

    ``with_curve``: a drift along a free curve is not compensated where it is the only effect.
    """
    shown = _shown(found, sensor, with_curve=with_curve)
    if shown is None:
        return ()
    values, time_s, density = shown
    length_s, means = _poses(time_s, recording, segments)
    if sensor == "gyroscope":
        sigma = density / np.sqrt(length_s)[:, None]
        return tuple(PoseBiases(values[:, k], sigma[:, k], time_s, length_s) for k in range(3))
    if means is None:
        return ()
    S, b = (np.array(found.extended.accelerometer[name]) for name in ("S", "b"))
    up = directions_of(correct(means, S, b))
    return (PoseBiases(values[:, 0], np.sqrt((up**2 @ density**2) / length_s), time_s, length_s, up),)


def _shown(found: Diagnosis, sensor: Sensor, *, with_curve: bool) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Residuals of a sensor's poses (n, c), their times (n,) and the density of its white noise (3,)."""
    density = found.noise.get(f"{sensor}_density")
    shown = next((r for r in found.residuals if r.domain == DOMAINS[sensor] and len(r.after) > 1), None)
    if density is None or shown is None:
        return None
    white: FloatArray = np.asarray(density, dtype=np.float64)
    if with_curve and _has_curve(found, sensor):
        return shown.before, shown.time_before_s, white
    return shown.after, shown.time_after_s, white


def _poses(shown_s: FloatArray, recording: Recording, segments: Segments) -> tuple[FloatArray, FloatArray | None]:
    """Durations (n,) [s] and mean readings (n, 3) of the poses in a diagnosis: cut where they were disturbed, or whole.

    Pieces with the duration of the whole pose would overlap: no covariance of their means, and too small an error.
    """
    cut, t = resegment(recording, segments), recording.time_s

    def of(poses: Segments) -> tuple[float, FloatArray, FloatArray | None]:
        begin = np.array([t[pose.start] for pose in poses.poses])
        end = np.array([t[pose.stop - 1] for pose in poses.poses])
        away = np.abs(np.subtract.outer(shown_s, 0.5 * (begin + end)))
        nearest = np.argmin(away, axis=1)
        length = (end - begin)[nearest] + 1.0 / recording.rate_hz
        mean = poses.accelerometer_mean
        return float(away.min(axis=1).max()), length, None if mean is None else mean[nearest]

    _, length_s, means = min((of(cut), of(segments if cut.whole is None else cut.whole)), key=lambda one: one[0])
    return length_s, means


def _remark(sensor: Sensor, found: SlowDifference, common: float, rate_hz: float) -> Words:
    root = math.sqrt(rate_hz)
    for factor, is_above in ((root, True), (1.0 / root, False)):
        if found.term == "K" and max(common / factor, factor / common) < RESEMBLES_SLOW:
            return words("walk-by-rate", sensor=NAMES[sensor], ratio=common, rate_hz=rate_hz, is_above=is_above)
    return words("slow-ratio", sensor=NAMES[sensor], ratio=common, is_flicker=found.term == "B")


def _unseen(term: str, model: Measured, recording: Measured) -> Words:
    unseen = [(side, one.upper) for side, one in (("model", model), ("recording", recording)) if not one.lower > 0.0]
    return words("slow-unseen", term=term, unseen=unseen)
