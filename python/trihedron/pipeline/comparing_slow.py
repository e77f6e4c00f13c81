"""Bias instability and rate random walk of a given simulation against the recording's, by the zeros of their poses."""

from __future__ import annotations

import math

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.noise.of_zeros import PoseZeros, SlowDifference, compare_slow
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import Diagnosis, NoiseDifference, NoiseTerm
from trihedron.segment import resegment

LEAST_SLOW_RATIO = 2.0
"""Bias instability differs by half from one part of a reel to the next and with the day; makers state no spread."""
RESEMBLES_SLOW = 1.5
"""A session tells a walk to some 30 %: a ratio this near to the root of the rate is taken for it."""
TESTS = 12.0
"""Shares of alpha: as many as the white densities of both logs have."""
NO_SHAPE = frozenset({"gyro-zero-scatter", "disturbed-pose", "periodic-interference"})
"""Effects that leave the mean zeros of the poses as they are."""
AXES = ("x", "y", "z")


def slow_noise(
    model: tuple[Diagnosis, Recording, Segments], recording: tuple[Diagnosis, Recording, Segments], *, alpha: float
) -> tuple[NoiseDifference, ...]:
    """B and K of the gyro, axis by axis, where both logs have poses enough; what the accelerometer's lengths show not.

    Significant where chance makes such a difference in fewer than ``alpha``/12 and the ratio is beyond a factor of two.
    """
    # A free curve through a simulation's zeros is no mechanism: its walk is. A recording's may be one.
    zeros = gyro_zeros(*model, with_curve=True), gyro_zeros(*recording, with_curve=_has_curve(model[0]))
    if not zeros[0] or not zeros[1]:
        return ()
    found = compare_slow(*zeros)
    if found is None:
        return ()
    rate_hz = model[1].rate_hz
    common = math.exp(float(np.mean([math.log(r[found.term].value) for r in found.ratio])))
    differs = found.p_value < alpha / TESTS and max(common, 1.0 / common) > LEAST_SLOW_RATIO
    out = []
    terms: tuple[NoiseTerm, NoiseTerm] = ("B", "K")
    for term in terms:
        unit = "rad/s" if term == "B" else "rad/s/sqrt(s)"
        is_it = differs and term == found.term
        remark = _remark(found, common, rate_hz) if is_it else ""
        for k, axis in enumerate(AXES):
            m, r, ratio = found.first[k][term], found.second[k][term], found.ratio[k][term]
            is_shown = m.lower > 0.0 and r.lower > 0.0
            out.append(
                NoiseDifference(
                    "gyroscope", axis, term, m.value, r.value, ratio.value if is_shown or is_it else None,
                    (ratio.lower, ratio.upper) if is_shown or is_it else None, unit, found.p_value, is_it,
                    remark or ("" if is_shown else _unseen(term, m.lower > 0.0, r.lower > 0.0)),
                )
            )  # fmt: skip
    return tuple(out)


def _has_curve(found: Diagnosis) -> bool:
    """Whether the one effect on the gyro's zeros, beside their scatter, is a drift along a curve of any shape."""
    of_zeros = [e for e in found.effects if any(h.domain == "static-gyro" for h in e.held_out) and e.id not in NO_SHAPE]
    return [(e.id, e.model.get("variant")) for e in of_zeros] == [("gyro-hidden-drift", "curve")]


def gyro_zeros(
    found: Diagnosis, recording: Recording, segments: Segments, *, with_curve: bool = False
) -> tuple[PoseZeros, ...]:
    """Zeros of a session's poses per axis, what effects make of them taken off; none without a gyro.

    ``with_curve``: a drift along a free curve stays on them where nothing else was taken off.
    """
    density = found.noise.get("gyroscope_density")
    shown = next((r for r in found.residuals if r.domain == "static-gyro" and len(r.after) > 1), None)
    if density is None or shown is None:
        return ()
    values, time_s = shown.after, shown.time_after_s
    if with_curve and _has_curve(found):
        values, time_s = shown.before, shown.time_before_s
    length = _lengths(time_s, recording, segments)
    white: FloatArray = np.asarray(density, dtype=np.float64)
    return tuple(PoseZeros(values[:, k], white[k] / np.sqrt(length), time_s, length, scatters=True) for k in range(3))


def _lengths(shown_s: FloatArray, recording: Recording, segments: Segments) -> FloatArray:
    """Lengths (n,) [s] of the poses that a diagnosis shows: cut where they were bumped, or left whole.

    Pieces of a pose with the length of all of it would overlap: no covariance of means then, and too small an error.
    """
    cut = resegment(recording, segments)
    t = recording.time_s
    best: tuple[float, FloatArray] | None = None
    for poses in (cut, segments if cut.whole is None else cut.whole):
        begin = np.array([t[hold.start] for hold in poses.holds])
        end = np.array([t[hold.stop - 1] for hold in poses.holds])
        away = np.abs(np.subtract.outer(shown_s, 0.5 * (begin + end)))
        nearest = np.argmin(away, axis=1)
        missed = float(away[np.arange(len(nearest)), nearest].max())
        if best is None or missed < best[0]:
            best = missed, (end - begin)[nearest] + 1.0 / recording.rate_hz
    assert best is not None
    return best[1]


def _remark(found: SlowDifference, common: float, rate_hz: float) -> str:
    name = "Bias instability" if found.term == "B" else "The walk"
    said = f"{name} of the gyro is {common:.2g} times the recording's"
    root = math.sqrt(rate_hz)
    if found.term == "K":
        for factor, words in (
            (root, f"√{rate_hz:.4g}: its steps were not scaled by the root of the time step"),
            (1.0 / root, f"1/√{rate_hz:.4g}: its steps were scaled by the time step instead of its root"),
        ):
            if max(common / factor, factor / common) < RESEMBLES_SLOW:
                return f"{said}, about {words}."
    return said + "."


def _unseen(term: str, m_shows: bool, r_shows: bool) -> str:
    sides = [side for side, shows in (("model", m_shows), ("recording", r_shows)) if not shows]
    which = "either log" if len(sides) == 2 else f"the {sides[0]}"
    return f"Not long enough to show {term} in {which}: the figure is a median, zero is not excluded."
