"""Noise and sampling of a simulated log against those of a recording, axis by axis, and likely causes of a ratio."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.channel_facts.pooled import ratio_of
from trihedron.comparison.fitted import FittedModel
from trihedron.comparison.rows import NAMES, SENSORS, UNIT, Sensor, difference, measured_row
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.probability import chdtrc
from trihedron.records import Pose, Recording
from trihedron.records.diagnosis import NoiseDifference
from trihedron.records.pose_noise import Measured, PoseNoise
from trihedron.records.sampling import TimestampKind
from trihedron.records.words import Words, words
from trihedron.sensor_model import axis_scales

NORMAL_EXCESS, UNIFORM_EXCESS = 0.0, -0.6
"""Excess kurtosis of differences of two normal and of two uniform numbers."""
ONE_DRAW, OWN_DRAWS = 0.75, 0.5
"""Smallest correlation of axes with one noise common to all (an LSB of twice the noise leaves as much), and the largest
of axes with noise of their own. Independent noise reaches neither; with ``FEWEST`` differences it reaches 0.2."""
FEWEST = 256


@dataclass(frozen=True)
class Draws:
    """Distribution of the ``n`` static differences of one sensor: their mean excess kurtosis, and ``likeness``, the
    smallest absolute correlation of any two axes."""

    n: int
    excess: float
    likeness: float

    @classmethod
    def of(cls, differences: FloatArray) -> "Draws":
        """Those of ``differences`` (n, 3) of neighbouring readings."""
        centred = differences - differences.mean(axis=0)
        power = np.maximum((centred**2).mean(axis=0), 1e-150)
        excess = (centred**4).mean(axis=0) / power**2 - 3.0
        products = np.abs(centred.T @ centred / len(centred)) / np.sqrt(np.outer(power, power))
        return cls(len(differences), float(excess.mean()), float(products.min()))


def compare_draws(
    sensor: Sensor, model: Draws, recording: Draws, noise: Sequence[PoseNoise]
) -> Iterator[NoiseDifference]:
    """Uniform noise in place of normal where the LSB is finer; the same random numbers on all three axes, where the
    recording's axes are independent."""
    n, middle = min(model.n, recording.n), 0.5 * (NORMAL_EXCESS + UNIFORM_EXCESS)
    is_fine = all(axis.reading_sigma > axis.step for axis in noise)
    # Four standard errors of a kurtosis of n correlated differences must fit between the two values.
    is_measured = is_fine and 4.0 * math.sqrt(48.0 / max(n, 1)) <= -middle
    if is_measured and model.excess < middle < recording.excess:
        remark = words("model-uniform", sensor=NAMES[sensor])
        yield difference(sensor, "distribution", (model.excess, recording.excess), "excess kurtosis", remark)
    if n >= FEWEST and model.likeness > ONE_DRAW and recording.likeness < OWN_DRAWS:
        likeness = {"model": model.likeness, "recording": recording.likeness}
        remark = words("model-one-draw", sensor=NAMES[sensor], **likeness)
        yield difference(sensor, "distribution", (model.likeness, recording.likeness), "correlation of axes", remark)


SHARE = 0.125
"""Share of alpha for each kind of figure (white densities, corners, octaves of both sensors): half of alpha is used for
the parameters, a twelfth for slow noise."""
LEAST_RATIO = 1.05
"""White noise of one part differs by 5 % over 30 K (thermal noise is proportional to the root of temperature)."""
LEAST_STEP_RATIO = math.sqrt(2.0)
"""Ranges of an ADC are powers of two: halfway between two of them."""
DIGITS = 0.1
"""LSB over noise below which it is ignored: a tenth adds a thousandth to the variance of the noise."""
LEAST_SEEN_STEP = 1e-2
"""LSB over noise below which it is not seen: hardly an ADC has a hundred codes in a standard deviation, sums of
readings and compensated readings come that near to a grid, and the digits of a file are as fine."""
FEWEST_ALIKE = 2
"""Axes with one common step, from which it is an ADC's."""
LEAST_CORNER_RATIO = 1.2
"""Filters are chosen from lists whose neighbours differ by 1.5 to 2; within a fifth they are the same entry."""
LEAST_RATE_RATIO = 1.02
"""Oscillators of cheap parts are specified to 1 to 2 %."""
LEAST_OCTAVE_RATIO = 1.5
"""Octaves below the white noise floor contain few periods per pose: smaller differences change from day to day."""
LEAST_JITTER = 0.05
"""Scatter of the timestamps, in sample intervals, from which it matters to a session (0.05 of 10 ms is 0.5 ms)."""
PERFECT_CLOCK = 1e-6
"""Scatter of the timestamps, in sample intervals, of a perfect clock: the rest is rounding of the file."""
SAME_ON_ALL_AXES = 1.05
"""Ratio within which three axes of a real part agree by chance in a few of a hundred parts."""
UNLIKE_AXES = 1.1
"""Ratio beyond which axes differ, if chance does not explain it."""
UNLIKE_BY_CHANCE = 0.01
"""p-value above which densities count as equal: measured to one or two per cent, equal ones often spread by 3 %."""
RESEMBLES = 1.06
"""A ratio this near to √rate, or to its inverse, is identified with it."""
SHOWS = 0.5
"""Noise over LSB from which readings show it: at one half the last digit changes in every third reading."""
_SCATTERED = (TimestampKind.LATE, TimestampKind.SCATTERED)


@dataclass(frozen=True, eq=False)
class Sampled:
    """Noise of both sensors in SI along their own axes, how it is drawn, and the clock."""

    noise: dict[Sensor, tuple[PoseNoise, ...]]
    draws: dict[Sensor, Draws]
    rate_hz: float
    jitter_steps: float
    has_timestamps: bool = True


def sampled(recording: Recording, poses: Sequence[Pose], model: FittedModel) -> Sampled:
    """Noise inside poses of a recording, scaled by its own fit."""
    ranges = [(pose.start, pose.stop) for pose in poses]
    noise: dict[Sensor, tuple[PoseNoise, ...]] = {}
    draws: dict[Sensor, Draws] = {}
    for sensor in SENSORS:
        readings, fitted = getattr(recording, sensor), getattr(model, sensor)
        if readings is None or fitted is None:
            continue
        si = readings * axis_scales(fitted.S)
        try:
            noise[sensor] = noise_of_poses(si, recording.rate_hz, ranges)
        except INPUT_ERRORS:
            continue  # no pose is long enough: nothing to compare
        differences = np.concatenate([np.diff(si[a:b], axis=0) for a, b in ranges if b - a > 2])
        draws[sensor] = Draws.of(differences[np.isfinite(differences).all(axis=1)])
    steps = np.diff(recording.time_s)
    nominal = 1.0 / recording.rate_hz
    away = steps[np.abs(steps - nominal) < 0.9 * nominal] / nominal - 1.0
    jitter = float(np.std(away)) / math.sqrt(2.0) if len(away) else 0.0
    clock = recording.sampling
    has_timestamps = clock.kind is not TimestampKind.NONE or jitter > PERFECT_CLOCK
    if clock.is_even and clock.kind in _SCATTERED:
        # The reader replaced the timestamps by an even clock: their scatter is in its report.
        jitter = max(jitter, clock.timestamp_error_s * recording.rate_hz)
    return Sampled(noise, draws, recording.rate_hz, jitter, has_timestamps)


def compare_noise(model: Sampled, recording: Sampled, *, alpha: float) -> tuple[NoiseDifference, ...]:
    """Every figure that both logs have, ratio model over recording; significant beyond chance and the spread of parts.

    ``alpha``: chance that anything of two logs of one unit is called different; three eighths of it are spent here.
    """
    out: list[NoiseDifference] = []
    for sensor in SENSORS:
        if sensor not in model.noise or sensor not in recording.noise:
            continue
        pairs = list(zip(AXES, model.noise[sensor], recording.noise[sensor], strict=True))
        n_octaves = 2 * sum(len(r.octaves) for _, _, r in pairs)
        white = [_white(sensor, axis, m, r, alpha * SHARE / 6.0) for axis, m, r in pairs]
        even = _are_even([m.white for _, m, _ in pairs]) and not _are_even([r.white for _, _, r in pairs])
        out += _resembling(sensor, [w for w in white if w is not None], model.rate_hz, even)
        is_one_part = all(
            len({one.corner_hz for one in side}) == 1 for side in (model.noise[sensor], recording.noise[sensor])
        )
        for axis, m, r in pairs:
            out += _step(sensor, axis, (m, model.noise[sensor]), (r, recording.noise[sensor]))
            # Axes that share a filter have one corner, measured on all of them: one test.
            corners = [] if is_one_part and axis != AXES[0] else [*_corner(sensor, axis, m, r, alpha * SHARE / 6.0)]
            out += [replace(row, axis="") if is_one_part else row for row in corners]
            out += _octaves(sensor, axis, m, r, alpha * SHARE / max(n_octaves, 1))
        noise = (*model.noise[sensor], *recording.noise[sensor])
        out += compare_draws(sensor, model.draws[sensor], recording.draws[sensor], noise)
    out += _sampling(model, recording)
    return tuple(out)


def _values(m: Measured | None, r: Measured | None) -> tuple[float | None, float | None]:
    return None if m is None else m.value, None if r is None else r.value


def _white(sensor: Sensor, axis: str, m: PoseNoise, r: PoseNoise, alpha: float) -> NoiseDifference | None:
    unit = f"{UNIT[sensor]}/sqrt(Hz)"
    if m.white is None or r.white is None or not (m.white.value > 0.0 and r.white.value > 0.0):
        return None if (m.white is None) == (r.white is None) else _hidden(sensor, axis, m, r, unit)
    return measured_row(sensor, axis, "N", (m.white, r.white), unit, LEAST_RATIO, alpha)


def _hidden(sensor: Sensor, axis: str, m: PoseNoise, r: PoseNoise, unit: str) -> NoiseDifference:
    """One side shows no noise: its LSB hides it, or it has none where noise like the other's would show."""
    quiet, loud = (m, r) if m.white is None or not m.white.value > 0.0 else (r, m)
    side, other = ("model", "recording") if quiet is m else ("recording", "model")
    assert loud.white is not None
    would_show = loud.reading_sigma > SHOWS * quiet.step
    case = "noise-missing" if would_show else "noise-hidden"
    remark = words(case, side=side, other=other, sensor=NAMES[sensor])
    return replace(difference(sensor, "N", _values(m.white, r.white), unit, remark, axis=axis), significant=would_show)


def _resembling(
    sensor: Sensor, white: Sequence[NoiseDifference], rate_hz: float, only_model_is_even: bool
) -> list[NoiseDifference]:
    """White densities with the likely cause of their ratio: known mistakes of simulators."""
    name = NAMES[sensor]
    known = [w for w in white if w.ratio is not None]
    if len(known) < 3 or not any(w.significant for w in known):
        return list(white)
    ratios = np.array([w.ratio for w in known], dtype=np.float64)
    common = float(np.exp(np.mean(np.log(ratios))))
    root = math.sqrt(rate_hz)
    for factor, is_above in ((root, True), (1.0 / root, False)):
        if max(common / factor, factor / common) < RESEMBLES:
            remark = words("white-by-rate", sensor=name, ratio=common, rate_hz=rate_hz, is_above=is_above)
            return [replace(w, remark=remark) if w in known else w for w in white]
    seen = np.array([w.recording or 0.0 for w in known])
    said = Words("")
    if only_model_is_even and seen.max() > UNLIKE_AXES * seen.min():
        said = words("white-same-on-axes", sensor=name, times=float(seen.max() / seen.min()))
    elif ratios.max() < LEAST_OCTAVE_RATIO * ratios.min():
        low = min(w.interval[0] for w in known if w.interval)
        high = max(w.interval[1] for w in known if w.interval)
        said = words("white-ratio", sensor=name, ratio=common, low=low, high=high)
    return [replace(w, remark=said) if said and w.significant else w for w in white]


def _are_even(white: Sequence[Measured | None]) -> bool:
    """Whether the densities of three axes agree within their uncertainty and 5 %."""
    known = [w for w in white if w is not None and w.value > 0.0]
    if len(known) < len(AXES):
        return False
    logs = np.log([w.value for w in known])
    if float(np.ptp(logs)) < math.log(SAME_ON_ALL_AXES):
        return True
    weight = 1.0 / np.maximum([w.sigma_log for w in known], 1e-9) ** 2
    away = logs - float(weight @ logs / weight.sum())
    chance = chdtrc(len(known) - 1.0, float(weight @ away**2))
    return chance > UNLIKE_BY_CHANCE and float(np.ptp(logs)) < math.log(UNLIKE_AXES)


def _step(
    sensor: Sensor,
    axis: str,
    model: tuple[PoseNoise, Sequence[PoseNoise]],
    recording: tuple[PoseNoise, Sequence[PoseNoise]],
) -> Iterator[NoiseDifference]:
    """Difference of the LSB of one axis, each side given with all axes of its sensor."""
    m, r = model[0], recording[0]
    m_shows, r_shows = _shows_steps(*model), _shows_steps(*recording)
    if not (m_shows or r_shows):
        return
    if not (m_shows and r_shows):
        # Readings finer than their noise shows: only an LSB larger than the noise is missed.
        coarse = m if m_shows else r
        side = "recording" if m_shows else "model"
        is_missed = coarse.step > coarse.reading_sigma
        remark = words("resolution-missing", side=side, sensor=NAMES[sensor]) if is_missed else ""
        yield difference(sensor, "resolution", (m.step, r.step), UNIT[sensor], remark, axis=axis)
        return
    ratio = m.step / r.step
    levels = [one.reading_sigma for one in (m, r) if one.reading_sigma > 0.0]
    # Steps far below the noise may be the digits of a file.
    is_seen = not levels or max(m.step, r.step) > DIGITS * min(levels)
    is_far = max(ratio, 1.0 / ratio) > LEAST_STEP_RATIO and is_seen
    remark = words("resolution-ratio", sensor=NAMES[sensor], ratio=ratio) if is_far else ""
    yield difference(sensor, "resolution", (m.step, r.step), UNIT[sensor], remark, axis=axis, ratio=ratio)


def _shows_steps(one: PoseNoise, axes: Sequence[PoseNoise]) -> bool:
    """Whether readings show an LSB: a step far below the noise is chance, not an ADC.

    So is one that no other axis has: the axes of a sensor share an ADC.
    """
    alike = sum(max(one.step, other.step) < LEAST_STEP_RATIO * min(one.step, other.step) for other in axes)
    if one.step > 0.0 and alike < min(FEWEST_ALIKE, len(axes)):
        return False
    return one.step > LEAST_SEEN_STEP * one.reading_sigma


def _corner(sensor: Sensor, axis: str, m: PoseNoise, r: PoseNoise, alpha: float) -> Iterator[NoiseDifference]:
    if m.corner_hz is not None and r.corner_hz is not None:
        yield measured_row(sensor, axis, "bandwidth", (m.corner_hz, r.corner_hz), "Hz", LEAST_CORNER_RATIO, alpha)
        return
    seen, other = (m, r) if m.corner_hz is not None else (r, m)
    if seen.corner_hz is None:
        return
    is_clear = seen.corner_hz.upper * LEAST_CORNER_RATIO < other.corner_above_hz
    side = "recording" if seen is r else "model"
    remark = words("filtered-once", sensor=NAMES[sensor], axis=axis, side=side, corner_hz=seen.corner_hz.value)
    values = _values(m.corner_hz, r.corner_hz)
    yield difference(sensor, "bandwidth", values, "Hz", remark if is_clear else "", axis=axis)


def _octaves(sensor: Sensor, axis: str, m: PoseNoise, r: PoseNoise, alpha: float) -> Iterator[NoiseDifference]:
    """Octave by octave; significant where the ratio differs from that of the white noise and filter."""
    if m.white is None or r.white is None:
        return
    white = ratio_of(m.white, r.white)
    filters_differ = any(row.significant for row in _corner(sensor, axis, m, r, alpha))
    corners = [one.corner_hz.lower for one in (m, r) if one.corner_hz is not None]
    there = {o.low_hz: o for o in m.octaves}
    for octave in r.octaves:
        other = there.get(octave.low_hz)
        if other is None or not (other.density.value > 0.0 and octave.density.value > 0.0):
            continue
        ratio = ratio_of(other.density, octave.density)
        beyond = ratio.value / white.value**2
        is_far = max(beyond, 1.0 / beyond) > LEAST_OCTAVE_RATIO**2
        is_off = ratio.p_value < alpha and not ratio.lower < white.value**2 < ratio.upper
        # Above the corner the filter differs, which is reported by itself.
        is_off = is_off and not (filters_differ and octave.high_hz > min(corners))
        band = {"low_hz": octave.low_hz, "high_hz": octave.high_hz}
        remark = words("octave-ratio", sensor=NAMES[sensor], axis=axis, ratio=math.sqrt(ratio.value), **band)
        yield NoiseDifference(
            sensor, axis, "octave", math.sqrt(other.density.value), math.sqrt(octave.density.value),
            math.sqrt(ratio.value), (math.sqrt(ratio.lower), math.sqrt(ratio.upper)),
            f"{UNIT[sensor]}/sqrt(Hz)", ratio.p_value,
            bool(is_far and is_off), remark if is_far and is_off else "", (octave.low_hz, octave.high_hz),
        )  # fmt: skip


def _sampling(model: Sampled, recording: Sampled) -> Iterator[NoiseDifference]:
    ratio = model.rate_hz / recording.rate_hz
    remark = words("rate-ratio", model_hz=model.rate_hz, recording_hz=recording.rate_hz)
    is_far = max(ratio, 1.0 / ratio) > LEAST_RATE_RATIO
    rates = model.rate_hz, recording.rate_hz
    yield difference("both", "rate", rates, "Hz", remark if is_far else "", ratio=ratio)
    if not recording.has_timestamps:
        return
    # Timestamps on an even grid scatter by their rounding only.
    m, r = (0.0 if one.jitter_steps < PERFECT_CLOCK else one.jitter_steps / one.rate_hz for one in (model, recording))
    larger, smaller = max(model.jitter_steps, recording.jitter_steps), min(model.jitter_steps, recording.jitter_steps)
    is_far = larger > LEAST_JITTER and larger > 2.0 * smaller
    which = "model" if m > r else "recording"
    remark = words("timestamps-scatter", side=which, larger_s=max(m, r), smaller_s=min(m, r))
    if which == "recording" and model.jitter_steps < PERFECT_CLOCK:
        remark = words("clock-perfect", jitter_s=r)
    yield difference("both", "jitter", (m, r), "s", remark if is_far else "", ratio=m / r if r > 0.0 else None)
