"""A session of known truth, and its text in a drawn layout."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from formats.layout import FORCE_UNITS, PER_S, RATE_UNITS, TICKS, UNIT_TIME_NAMES, G, Layout, Rng, pick

POSE_S, TURN_S = 2.5, 1.5
START = datetime(2024, 11, 3, 16, 20, 31, 500000, UTC)
Columns = dict[str, list[str]]


@dataclass(frozen=True)
class Session:
    """One part's raw readings in SI: time (n,) [s], specific force (n, 3), rate (n, 3); S (3, 3) of both sensors."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    s_force: np.ndarray
    s_rate: np.ndarray

    @property
    def n(self) -> int:
        return len(self.time_s)


def session(rng: Rng, rate_hz: float, n_poses: int = 18) -> Session:
    """Poses of a hand-held part in all directions, turns of 60 to 150 degrees about level-ish axes between."""
    n = round((n_poses * (POSE_S + TURN_S) + POSE_S) * rate_hz)
    time_s = np.arange(n) / rate_hz
    phase = (time_s / (POSE_S + TURN_S)) % 1.0 * (POSE_S + TURN_S) - POSE_S
    leg = (time_s // (POSE_S + TURN_S)).astype(int)
    u = np.clip(phase / TURN_S, 0, 1)
    angle, speed = u - np.sin(2 * np.pi * u) / (2 * np.pi), (1 - np.cos(2 * np.pi * u)) / TURN_S
    attitude, force, rate = Rotation.identity(), np.empty((n, 3)), np.empty((n, 3))
    for k in range(leg[-1] + 1):
        rows = leg == k
        up = attitude.inv().apply([0, 0, 1.0])
        axis = np.cross(up, rng.standard_normal(3)) + 0.3 * rng.standard_normal(3)
        vector = axis / np.linalg.norm(axis) * rng.uniform(1.1, 2.6)
        turned = attitude * Rotation.from_rotvec(angle[rows, None] * vector)
        force[rows], rate[rows] = turned.inv().apply([0, 0, G]), speed[rows, None] * vector
        attitude = attitude * Rotation.from_rotvec(vector)
    lower = np.tril(np.eye(3) + 0.01 * rng.standard_normal((3, 3)))
    s_rate = np.eye(3) + 0.01 * rng.standard_normal((3, 3))
    raw_force = (force - 0.1 * rng.standard_normal(3)) @ np.linalg.inv(lower).T + 0.01 * rng.standard_normal((n, 3))
    raw_rate = (rate - 0.01 * rng.standard_normal(3)) @ np.linalg.inv(s_rate).T + 0.001 * rng.standard_normal((n, 3))
    return Session(time_s, raw_force, raw_rate, lower, s_rate)


def whole(x: np.ndarray) -> list[str]:
    return [str(v) for v in np.rint(x).astype(np.int64)]


def clock_columns(of: Layout, t: np.ndarray, rng: Rng) -> Columns:
    """Columns of time by name, as a logger of this kind writes them."""
    utc, epoch = [START + timedelta(seconds=float(x)) for x in t], START.timestamp()
    kind = of.clock.removeprefix("epoch ")
    if kind in PER_S:
        name = pick(rng, UNIT_TIME_NAMES[kind]) if of.clock_unit_said else of.time_name
        start = epoch if "epoch" in of.clock else float(pick(rng, [0.0, 3.217, 812.5, 40321.25]))
        if kind == "s":
            return {name: [f"{start + x:.5f}" for x in t]}
        return {name: [str(round(start * 1000) * int(PER_S[kind]) // 1000 + round(x * PER_S[kind])) for x in t]}
    written: dict[str, Callable[[], Columns]] = {
        "iso": lambda: {of.time_name: [f"{x:%Y-%m-%dT%H:%M:%S.%f}" for x in utc]},
        "iso Z": lambda: {of.time_name: [f"{x:%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z" for x in utc]},
        "date slash": lambda: {of.time_name: [f"{x:%Y/%m/%d %H:%M:%S.%f}"[:-3] for x in utc]},
        "day time": lambda: {of.time_name: [f"{x:%H:%M:%S.%f}"[:-3] for x in utc]},
        "two columns": lambda: {"secs": [str(int(epoch + x)) for x in t],
                                "nsecs": whole((epoch + t) % 1 * 1e9)},
        "ticks said": lambda: {"ticks" + of.bracket.format(of.options["tick"]): whole(t * TICKS[of.options["tick"]])},
        "ticks remark": lambda: {"ticks": whole(t * TICKS[of.options["tick"]])},
        "ticks bare": lambda: {of.time_name: whole(t * TICKS[of.options["tick"]] + pick(rng, [0, 71234]))},
    }  # fmt: skip
    if of.clock in ("counter", "counter and rate"):
        name = pick(rng, ["sample", "n", "count", "index", "#", "Sample No", "frame", of.time_name])
        return {name: whole(np.arange(len(t)) + pick(rng, [0, 1, 5121]))}
    return written[of.clock]() if of.clock in written else {}


def extra_columns(of: Layout, made: Session, rng: Rng) -> Columns:
    """Columns of other sensors and of bookkeeping, with values as such columns have them."""
    t, n = made.time_s, len(made.time_s)
    quaternion = np.cumsum(0.01 * rng.standard_normal((n, 4)), 0) + rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, None]
    warm = [f"{x:.2f}" for x in 27 + 0.008 * t + 0.02 * rng.standard_normal(n)]
    fields = [f"{x:.2f}" for x in (4.6 * made.force + 11).ravel()]
    table: dict[str, Callable[[], Columns]] = {
        "temperature": lambda: {pick(rng, ["temp", "Temperature", "temp_degC", "T", "imu_temp"]): warm},
        "magnetometer": lambda: {k: fields[i::3] for i, k in enumerate(pick(rng, [
            ("mx", "my", "mz"), ("mag_x", "mag_y", "mag_z"), ("xmag", "ymag", "zmag")]))},
        "quaternion": lambda: {k: [f"{x:.5f}" for x in quaternion[:, i]] for i, k in enumerate(pick(rng, [
            ("qw", "qx", "qy", "qz"), ("q0", "q1", "q2", "q3")]))},
        "flags": lambda: {pick(rng, ["flags", "status", "valid"]): ["1"] * n},
        "checksum": lambda: {pick(rng, ["crc", "checksum", "cs"]): [str(v) for v in rng.integers(0, 256, n)]},
        "gps": lambda: {"lat": [f"{x:.7f}" for x in 48.1 + 1e-7 * t], "lon": [f"{x:.7f}" for x in 11.5 + 2e-7 * t],
                        "nsat": ["9"] * n},
        "pressure": lambda: {"press_abs": [f"{x:.2f}" for x in 1009 + 0.04 * rng.standard_normal(n)]},
        "voltage": lambda: {pick(rng, ["vbat", "Vcc", "battery_mV"]): [f"{x:.3f}" for x in 3.7 - 1e-4 * t]},
        "sequence": lambda: {pick(rng, ["seq", "pkt", "frame_id"]): whole(np.arange(n) % 256)},
    }  # fmt: skip
    return {name: cells for kind in of.extras for name, cells in table[kind]().items()}


def readings(of: Layout, made: Session, prefix: str = "") -> tuple[Columns, Columns]:
    """Columns of the accelerometer and of the gyroscope in the layout's units."""
    out: list[Columns] = []
    for k, (values, (size, _, product)) in enumerate(
        ((made.force, FORCE_UNITS[of.force_unit]), (made.rate, RATE_UNITS[of.rate_unit]))
    ):
        form = prefix + of.names[k] + (of.bracket.format(of.spelt[k]) if of.units == "names" else "")
        wanted = whole if product in ("counts", "mg", "mdeg/s") else lambda x: [f"{v:.7g}" for v in x]
        out.append({
            form.format(u=a, U=a.upper(), n=i, m=i + 1, p="pqr"[i]): wanted(values[:, i] / size)
            for i, a in enumerate("xyz")
        })  # fmt: skip
    return out[0], out[1]


def table_of(of: Layout, parts: list[Session], rng: Rng) -> tuple[list[str], list[tuple[str, ...]], dict[str, str]]:
    """Names, rows of cells, and the unit of each name."""
    clock, extras = clock_columns(of, parts[0].time_s, rng), extra_columns(of, parts[0], rng)
    (force, rate), spelt = readings(of, parts[0], "A_" if of.devices == "columns" else ""), of.spelt
    if of.order == "by axis":
        sensors = {k: v for pair in zip(force.items(), rate.items(), strict=True) for k, v in pair}
    else:
        sensors = rate | force if of.order == "gyro first" else force | rate
    if of.devices == "columns":
        sensors |= {k: v for half in readings(of, parts[1], "B_") for k, v in half.items()}
    middle = extras | sensors if of.order == "extras between" else sensors | extras
    table = middle | clock if of.order == "time last" else clock | middle
    units = dict.fromkeys(force, spelt[0]) | dict.fromkeys(rate, spelt[1])
    names, rows = list(table), list(zip(*table.values(), strict=True))
    if of.devices not in ("one", "columns"):
        shift = 0.005 if of.devices == "5 ms apart" else 0.0
        again = clock_columns(of, parts[0].time_s + shift, np.random.default_rng(int(rng.integers(2**31))))
        theirs = table | dict(zip(clock, again.values(), strict=True))
        cells = [column for half in readings(of, parts[1]) for column in half.values()]
        other = list(zip(*(theirs | dict(zip([*force, *rate], cells, strict=True))).values(), strict=True))
        names, rows = woven(of, names, rows, other)
    return names, rows, units | dict.fromkeys(clock, of.clock if of.clock in PER_S else "-")


def woven(of: Layout, names: list[str], one: list[tuple[str, ...]], two: list[tuple[str, ...]]) -> Any:
    """Rows of two devices in one stream, with a column that separates them where the layout has one."""
    length = {"blocks": len(one), "bursts": 4}.get(of.devices, 1)
    marked = of.devices in ("id column", "blocks", "bursts")
    rows: list[tuple[str, ...]] = []
    for k in range(0, len(one), length):
        for which, half in enumerate((one, two)):
            head = (of.options["values"][which],) if marked else ()
            rows += [(*head, *row) for row in half[k : k + length]]
    return ([of.options["id"], *names] if marked else names), rows


def number(cell: str) -> float | int | str:
    try:
        return int(cell)
    except ValueError:
        try:
            return float(cell)
        except ValueError:
            return cell


def triad_names(of: Layout, k: int) -> list[str]:
    """Names of the accelerometer (``k`` 0) or the gyroscope (1) without units."""
    return [of.names[k].format(u=a, U=a.upper(), n=i, m=i + 1, p="pqr"[i]) for i, a in enumerate("xyz")]


def glued(cell: str) -> str:
    """A cell without blanks, for tables whose columns blanks part."""
    return cell.replace(" ", "T" if cell[:1].isdigit() else "_")


def structured(of: Layout, names: list[str], rows: list[tuple[str, ...]]) -> str:
    """JSON and prints with labels."""
    cells = [dict(zip(names, row, strict=True)) for row in rows]
    if of.writing == "json columns":
        return json.dumps({k: [number(row[k]) for row in cells] for k in names}, ensure_ascii=False)
    sensors = [triad_names(of, k) for k in (0, 1)]
    if of.writing == "json nested":
        made = [{k: number(v) for k, v in row.items() if k not in sensors[0] + sensors[1]}
                | {key: {a: number(row[k]) for a, k in zip("xyz", triad, strict=True)}
                   for key, triad in zip(("acc", "gyro"), sensors, strict=True)} for row in cells]  # fmt: skip
        return "".join(json.dumps(row) + "\n" for row in made)
    if of.writing.startswith("json"):
        objects = [{k: number(v) for k, v in row.items()} for row in cells]
        if of.writing == "json":
            return json.dumps(objects, ensure_ascii=False)
        return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in objects)
    plain = [k for k in names if k not in sensors[0] + sensors[1]]
    if of.writing == "labelled":
        join = "\t" if of.separator == "\t" else " "
        return "".join(join.join(f"{k.replace(' ', '')}:{v}" for k, v in row.items()) + "\n" for row in cells)
    lines = [
        [f"{k}: {row[k]}" for k in plain]
        + [
            f"{label}: " + ", ".join(row[k] for k in triad)
            for label, triad in zip(("Accel", "Gyro"), sensors, strict=True)
        ]
        for row in cells
    ]
    between = "\n" if of.writing == "labelled lines" else "  "
    return "".join(between.join(line) + "\n" for line in lines)


def roles(of: Layout, names: list[str], clock: list[str]) -> str:
    """`--columns` of a table without names."""
    triads = [(f"{s}{a}", name) for k, s in enumerate("ag") for a, name in zip("xyz", triad_names(of, k), strict=True)]
    times = [("time", k) for k in clock[:1] if "count" not in of.clock]
    return ",".join(f"{role}={names.index(k) + 1}" for role, k in times + triads if k in names)


def text(of: Layout, parts: list[Session], rng: Rng) -> str:
    """The file's text."""
    names, rows, units = table_of(of, parts, rng)
    mark = of.remark or "# "
    head = f"{of.remark}Data logger, firmware 3.2.1\n{of.remark}Serial no. 17-0042\n" if of.remark else ""
    if of.units == "remark":
        head += f"{mark}accelerometer: {of.spelt[0]}, gyroscope: {of.spelt[1]}\n"
    if of.clock in ("counter and rate", "none and rate"):
        said = pick(rng, ["Sampling rate: {} Hz", "ODR = {} Hz", "fs={} Hz", "sample_rate_hz: {}"])
        head += mark + said.format(f"{of.rate_hz:g}") + "\n"
    if of.clock == "ticks remark":
        head += mark + pick(rng, ["1 tick = {}", "tick: {}", "time in ticks of {}"]).format(of.options["tick"]) + "\n"
    if of.writing.startswith(("json", "labelled")):
        return (head if of.writing.startswith("labelled") else "") + structured(of, names, rows)
    lines: list[Any] = [] if of.writing == "no names" else [names]
    of.options["columns"] = roles(of, names, list(units)[6:])
    if of.units == "row":
        lines.append([units.get(k, "-") for k in names])
    point = (lambda v: v.replace(".", ",") if isinstance(number(v), float) else v) if of.comma else str
    lines += [[point(v) for v in row] for row in rows]
    if of.writing == "fixed":
        plain = [[glued(c) for c in line] for line in lines]
        wide = [max(map(len, column)) + 2 for column in zip(*plain, strict=True)]
        return head + "".join("".join(c.rjust(w) for c, w in zip(line, wide, strict=True)) + "\n" for line in plain)
    if of.separator == " ":
        lines = [[glued(c) for c in line] for line in lines]
    return head + "".join(of.separator.join(line) + "\n" for line in lines)
