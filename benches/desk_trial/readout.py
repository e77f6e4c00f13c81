"""From what the axes are given to what the log holds: zeros, noise, decimation filter, converter, stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len

from desk_trial.flaws import Flaw
from desk_trial.parts import STANDARD_G, Session, Unit
from desk_trial.sensing import FIRST_TEMPERATURE, SUPPLY_V, Body
from desk_trial.turns import DEGREE, Array, flicker, low_pass, moving_average, second_order, stream

ACCEL_RANGE_G = 4.0
GYRO_RANGES_DPS = (125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0)
LAST_RANGE_DPS = 8000.0
HEADROOM = 1.15
CODES = 32768
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Log:
    """Rows of the log. ``stamps`` s; ``accel``, ``gyro`` SI; ``*_step`` SI per code; ``stamp_kind`` none: no stamps,
    made: stamps at the nominal rate. ``*_zero`` are the true zeros, means over the poses; ``clock_ratio`` is the time
    the log says over the true one; ``pose`` the true pose of every row, -1 in moves.
    """

    stamps: Array
    stamp_kind: str
    accel: Array
    gyro: Array
    accel_step: float
    gyro_step: float
    temperature: Array
    supply: Array | None
    pose: Array
    accel_zero: Array
    gyro_zero: Array
    clock_ratio: float


def _zeros(b: Body, s: Session, unit: Unit, flaw: Flaw, seed: int) -> tuple[Array, Array]:
    """(N, 3) zeros: constant, with temperature, another in every pose, and their 1/f noise is added later."""
    n, rows, name = s.poses, len(b.force), flaw.get("id")
    accel, gyro = np.tile(unit.accel_zero, (rows, 1)), np.tile(unit.gyro_zero, (rows, 1))
    if "warming_k" not in flaw:
        accel += b.warming[:, None] * unit.accel_zero_per_k
        gyro += b.warming[:, None] * unit.gyro_zero_per_k
    rng = stream(seed, "scatter")
    in_accel, in_gyro = s.accel_scatter * rng.normal(size=(n, 3)), s.gyro_scatter * rng.normal(size=(n, 3))
    if name == "gyro-zero-scatter":
        in_gyro = flaw["size"] * np.array(flaw["axes"]) * rng.normal(size=(n, 3))
    if name == "accel-zero-scatter":
        in_accel = flaw["size"] * rng.normal(size=(n, 3))
    edges = np.array(b.motion.rests).ravel()
    for j in range(3):
        accel[:, j] += np.interp(b.motion.time, edges, np.repeat(in_accel[:, j], 2))
        gyro[:, j] += np.interp(b.motion.time, edges, np.repeat(in_gyro[:, j], 2))
    return accel, gyro


def _noise(b: Body, unit: Unit, seed: int) -> tuple[Array, Array, Array, Array]:
    """(N, 3) 1/f of both sensors, white of both."""
    rng, n = stream(seed, "noise"), len(b.force)
    longer = next_fast_len(n)
    slow = [np.stack([flicker(rng, longer, b.rate, level)[:n] for _ in range(3)], 1)
            for level in (unit.accel_flicker, unit.gyro_flicker)]  # fmt: skip
    white = [rng.normal(size=(n, 3)) * density * np.sqrt(b.rate / 2)
             for density in (unit.accel_density, unit.gyro_density)]  # fmt: skip
    return slow[0], slow[1], white[0], white[1]


def _lines(b: Body, s: Session, unit: Unit, flaw: Flaw, rate: float) -> tuple[Array, Array]:
    """(N, 3) periodic interference behind the filter: the faint one of some sessions, and the flaw."""
    out = {"accel": np.zeros_like(b.force), "gyro": np.zeros_like(b.w)}
    t = b.motion.time
    if s.line:
        density = unit.accel_density if s.line_sensor == "accel" else unit.gyro_density
        wave = s.line * np.sin(2 * np.pi * s.line_cycles * rate * t + 1)
        out[s.line_sensor][:, s.line_axis] += density * np.sqrt(rate / 2) * 0.25 * wave
    if flaw.get("id") == "periodic-interference":
        out[flaw["sensor"]][:, flaw["axis"]] += flaw["amplitude"] * np.sin(2 * np.pi * flaw["hz"] * t)
    return out["accel"], out["gyro"]


def _auto_zeroed(gyro: Array, unit: Unit, flaw: Flaw, rate: float) -> Array:
    """Firmware that, while it thinks itself still, steers its zero register to nought."""
    level = low_pass(np.linalg.norm(gyro - unit.gyro_zero, axis=1)[:, None], 0.3, rate)[:, 0]
    still = np.abs(level) < 1.5 * DEGREE + 4 * unit.gyro_density * np.sqrt(rate / 2)
    register, out, gain = np.zeros(3), np.zeros_like(gyro), 1 / (rate * flaw["tau_s"])
    for i, reading in enumerate(gyro):
        if still[i]:
            register = register + gain * (reading - register)
        out[i] = reading - register
    return out


def _sampled(at: Rows, accel: Array, gyro: Array, unit: Unit, flaw: Flaw, rng: np.random.Generator,
             rates: tuple[float, float]) -> tuple[Array, Array]:  # fmt: skip
    """Readings at these fine rows, with what a driver or firmware does to them; ``rates`` fine, of samples (Hz)."""
    name = flaw.get("id")
    a, w = accel[at], gyro[at]
    if name == "accel-gyro-time-offset":
        late = at - flaw["offset_s"] * rates[0]
        w = np.stack([np.interp(late, np.arange(len(gyro)), c) for c in gyro.T], 1)
    if name == "stale-accel":
        a = a[np.arange(len(a)) // flaw["every"] * flaw["every"]]
    if name == "auto-zero":
        w = _auto_zeroed(w, unit, flaw, rates[1])
    if name == "glitches":
        rows = rng.choice(np.arange(len(a)), int(flaw["n"]), replace=False)
        channels = rng.integers(0, 6, size=int(flaw["n"]))
        for row, c in zip(rows, channels, strict=True):
            size = flaw["accel" if c < 3 else "gyro"] * rng.choice([-1, 1])
            (a if c < 3 else w)[row, c % 3] += size
    return a, w


def _converted(a: Array, w: Array, s: Session, flaw: Flaw) -> tuple[Array, Array, float, float]:
    """Codes of a 16-bit converter, and SI per code; the gyro's range is the least with headroom."""
    name = flaw.get("id")
    peak = np.abs(w).max() / DEGREE
    gyro_range = s.gyro_range_dps or min([r for r in GYRO_RANGES_DPS if r > HEADROOM * peak] or [LAST_RANGE_DPS])
    steps = {"accel": ACCEL_RANGE_G * STANDARD_G / CODES, "gyro": gyro_range * DEGREE / CODES}
    if name == "quantisation":
        steps[flaw["sensor"]] *= 2 ** flaw["bits"]
    ends = {"accel": np.round(ACCEL_RANGE_G * STANDARD_G / steps["accel"]),
            "gyro": np.round(gyro_range * DEGREE / steps["gyro"])}  # fmt: skip
    if name in ("gyro-saturation", "accel-saturation"):
        sensor = name.split("-")[0]
        ends[sensor] = np.round(flaw["limit"] / steps[sensor])
    codes = [np.clip(np.round(x / steps[k]), -ends[k], ends[k] - 1) for k, x in (("accel", a), ("gyro", w))]
    return codes[0], codes[1], steps["accel"], steps["gyro"]


def _stamped(t: Array, s: Session, kind: str, seed: int) -> Array:
    """(rows,) s that the logger writes for samples taken at t."""
    rng, n = stream(seed, "stamps"), len(t)
    if kind == "us":
        return np.asarray(np.round(t * 1e6) / 1e6 + 123.456)
    if kind == "ms":
        return np.asarray(np.round(t, 3) + 7.0)
    if kind == "late":
        late = t + rng.exponential(min(0.3 / s.rate_hz, 0.002), size=n) + 0.0005
        return np.asarray(np.maximum.accumulate(np.round(late, 4)))
    if kind == "burst":
        m = int(rng.choice([4, 8, 10, 16]))
        emptied = t[np.minimum((np.arange(n) // m + 1) * m - 1, n - 1)]
        late = emptied + np.repeat(rng.exponential(0.001, size=n // m + 1), m)[:n]
        return np.asarray(np.maximum.accumulate(np.round(late, 4)))
    if kind == "wrap":
        return np.asarray(np.mod(np.round((t + 4270) * 1e6), 2**32) / 1e6)
    return np.arange(n) / s.rate_hz


def _kept(t: Array, b: Body, flaw: Flaw) -> Array:
    keep = np.ones(len(t), bool)
    rests = b.motion.rests
    for move, share, m in flaw.get("lost", ()):
        first = np.searchsorted(t, rests[move][1] + share * (rests[move + 1][0] - rests[move][1]))
        keep[first : first + m] = False
    return keep


def read_out(b: Body, given: tuple[Array, Array], s: Session, unit: Unit, flaw: Flaw, seed: int) -> Log:
    """The log of a session whose axes are given these (N, 3) SI."""
    name, k, n = flaw.get("id"), s.oversampling, len(b.force)
    rate = b.rate / k
    accel_zero, gyro_zero = _zeros(b, s, unit, flaw, seed)
    slow_a, slow_w, white_a, white_w = _noise(b, unit, seed)
    accel_zero += slow_a
    gyro_zero += slow_w
    line_a, line_w = _lines(b, s, unit, flaw, rate)

    def filtered(x: Array) -> Array:
        if unit.filter_kind == "cic":
            return moving_average(x, k, unit.filter_order)
        return second_order(x, unit.filter_corner * rate, b.rate)

    accel = filtered(given[0] + accel_zero + white_a) + line_a
    gyro = filtered(given[1] + gyro_zero + white_w) + line_w
    rng = stream(seed, "flaw")
    at: Rows = np.arange(k * 4, n - 1, k, dtype=np.int64)
    t = b.motion.time[at]
    if name == "timing-jitter":
        jitter = np.clip(rng.normal(size=len(at)) * flaw["jitter_s"], -0.42 / s.rate_hz, 0.42 / s.rate_hz)
        at = np.clip(np.round(at + jitter * b.rate).astype(int), 0, n - 1)
        t = b.motion.time[at]
    a, w = _sampled(at, accel, gyro, unit, flaw, rng, (b.rate, rate))
    a, w, accel_step, gyro_step = _converted(a, w, s, flaw)
    keep = _kept(t, b, flaw)
    kind = "made" if flaw.get("even_stamps") or name == "dropped-samples" else s.stamps
    pose = np.full(n, -1)
    for i, (begin, end) in enumerate(b.motion.rests):
        pose[(b.motion.time >= begin) & (b.motion.time <= end)] = i
    rows = at[keep]
    pose = pose[rows]
    zeros = [np.mean([z[rows][pose == i].mean(0) for i in range(s.poses) if (pose == i).any()], 0)
             for z in (accel_zero, gyro_zero)]  # fmt: skip
    return Log(
        stamps=_stamped(t[keep] + 0.0021, s, kind, seed), stamp_kind=kind, accel=a[keep] * accel_step,
        gyro=w[keep] * gyro_step, accel_step=accel_step, gyro_step=gyro_step,
        temperature=FIRST_TEMPERATURE + b.warming[rows],
        supply=SUPPLY_V * (1 - b.supply[rows]) if name == "supply-sensitivity" else None, pose=pose,
        accel_zero=zeros[0], gyro_zero=zeros[1], clock_ratio=s.rate_hz / rate if kind in ("none", "made") else 1.0,
    )  # fmt: skip
