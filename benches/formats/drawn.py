"""Layouts drawn at random through `calibrate`: how many end as a confident wrong calibration, how many need no
question.

    python benches/formats/drawn.py [COUNT] [SEED] [--only K] [--keep FOLDER]

One session of known truth is written as clock x unit x names x order x extras x devices x language x writing, drawn
without regard to what the reader knows. *Wrong* is a calibration called trustworthy whose S (SI per number of the
file) leaves the truth by more than 2 % and six standard uncertainties, whose unit is another than the file's, or that
lost rows without a word. A layout is *open* where its text leaves out what nobody can know: no clock or ticks of an
unstated size, several devices, rare units unstated. There a question is the right answer; it is then answered with
the option that the layout needs, and the answer's outcome is counted too.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import trihedron
from trihedron.records import FindingCode

G = 9.80665
DEG = np.pi / 180
POSE_S, TURN_S = 2.5, 1.5
START = datetime(2024, 11, 3, 16, 20, 31, 500000, UTC)
Rng = np.random.Generator
Columns = dict[str, list[str]]

# Unit: size in m/s^2 or rad/s, its spellings, the product's name of it.
FORCE_UNITS: dict[str, tuple[float, tuple[str, ...], str]] = {
    "m/s2": (1.0, ("m/s^2", "m/s2", "m/s²", "m.s^-2", "mps2", "m/s/s", "m s-2"), "m/s^2"),
    "g": (G, ("g", "G", "gee", "g0", "g's"), "g"),
    "mg": (G * 1e-3, ("mg", "mG", "millig"), "mg"),
    "cm/s2": (0.01, ("cm/s^2", "cm/s²", "Gal", "cm/s2"), "cm/s^2"),
    "LSB 2g": (G / 16384, ("LSB", "raw", "counts", "ADC"), "counts"),
    "LSB 4g": (G * 0.122e-3, ("LSB", "raw", "digits"), "counts"),
    "LSB 16g": (G / 2048, ("LSB", "raw", "counts"), "counts"),
}
RATE_UNITS: dict[str, tuple[float, tuple[str, ...], str]] = {
    "rad/s": (1.0, ("rad/s", "rad.s^-1", "rad/sec", "rad s-1"), "rad/s"),
    "deg/s": (DEG, ("deg/s", "dps", "°/s", "deg/sec", "deg.s^-1", "º/s"), "deg/s"),
    "mdps": (DEG * 1e-3, ("mdps", "mdeg/s", "millidps"), "mdeg/s"),
    "mrad/s": (1e-3, ("mrad/s", "millirad/s"), "mrad/s"),
    "deg/h": (DEG / 3600, ("deg/h", "°/h", "deg/hr", "dph"), "deg/h"),
    "rpm": (np.pi / 30, ("rpm", "RPM", "r/min"), "rpm"),
    "LSB 250": (DEG / 131, ("LSB", "raw", "counts", "ADC"), "counts"),
    "LSB 500": (DEG * 17.5e-3, ("LSB", "raw", "digits"), "counts"),
    "LSB 2000": (DEG / 16.4, ("LSB", "raw", "counts"), "counts"),
}
# Names of makers and of people: accelerometer, gyroscope; {u} lower, {U} upper case, {n} 0 1 2, {m} 1 2 3.
NAMES: dict[str, tuple[tuple[str, str], ...]] = {
    "en": (
        ("{u}acc", "{u}gyro"), ("accel{U}", "rot{U}"), ("imu0_a{u}", "imu0_g{u}"), ("a{u}", "w{u}"),
        ("Acc_{U}", "Gyr_{U}"), ("linear_acceleration_{u}", "angular_velocity_{u}"), ("Acc{U}", "Gyr{U}"),
        ("accelerometer_{u}", "gyroscope_{u}"), ("Accel_{U}", "Gyro_{U}"), ("ACCEL_{U}OUT", "GYRO_{U}OUT"),
        ("accSmooth[{n}]", "gyroADC[{n}]"), ("Acc{m}", "Gyr{m}"),
        ("acc.{u}", "gyro.{u}"), ("A_{u}", "Omega_{u}"), ("userAcc_{u}", "gyro_{u}"), ("a_{u}", "om_{u}"),
        ("f{u}", "w{u}"), ("body_acc_{u}", "body_gyro_{u}"), ("sensors.accel.{u}", "sensors.gyro.{u}"),
        ("Accelerometer {U}-axis", "Gyroscope {U}-axis"), ("{U} Accel", "{U} Gyro"), ("RawAccel{U}", "RawGyro{U}"),
        ("imu.acc.{u}", "imu.gyr.{u}"), ("UncalAccel{U}", "UncalGyro{U}"), ("lsm6_acc_{u}", "lsm6_gyr_{u}"),
        ("XL_{u}", "G_{u}"), ("Accel Proper {U}", "Angular Rate {U}"), ("aRaw{U}", "gRaw{U}"),
        ("/imu/linear_acceleration/{u}", "/imu/angular_velocity/{u}"), ("IMU_Acc{U}", "IMU_Gyro{U}"),
        ("spec_force_{u}", "ang_rate_{u}"), ("Acceleration({U})", "AngularRate({U})"),
    ),
    "pqr": (("a{u}", "{p}"), ("N{u}", "{p}"), ("acc_{u}", "{p}")),
    "de": (
        ("Beschleunigung {U}", "Drehrate {U}"), ("Beschl. {U}", "Winkelgeschw. {U}"),
        ("beschleunigung_{u}", "gyroskop_{u}"),
    ),
    "fr": (
        ("Accélération {U}", "Vitesse angulaire {U}"), ("acceleration_{u}", "gyro_{u}"), ("accel {u}", "rotation {u}"),
    ),
    "es": (("Aceleración {U}", "Velocidad angular {U}"), ("aceleracion_{u}", "giroscopio_{u}")),
    "zh": (("加速度{U}", "角速度{U}"), ("{U}轴加速度", "{U}轴角速度"), ("加速度计_{u}", "陀螺仪_{u}")),
}  # fmt: skip
TIME_NAMES = {
    "en": ("time", "t", "timestamp", "Time", "elapsed", "uptime", "TimeStamp", "sampleTime"),
    "de": ("Zeit", "Zeitstempel"), "fr": ("temps", "horodatage"), "es": ("tiempo", "Marca de tiempo"),
    "zh": ("时间", "时间戳"), "pqr": ("t", "time"),
}  # fmt: skip
# A name that holds the unit, as firmware spells it.
UNIT_TIME_NAMES = {
    "s": ("t_s", "seconds", "Time (sec)", "time_sec"), "ms": ("ms", "timestampMs", "millis", "time_ms", "uptime_ms"),
    "us": ("ustime", "micros", "TimeUS", "usec", "timestamp_us", "time_usec"),
    "ns": ("t_ns", "timestamp [ns]", "nsec_elapsed"),
}  # fmt: skip
PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
TICKS = {"1/32768 s": 32768.0, "25 us": 40000.0, "39.0625 us": 25600.0, "62.5 us": 16000.0}
CLOCKS = ("s", "s", "ms", "ms", "us", "us", "ns", "epoch s", "epoch ms", "epoch us", "epoch ns", "iso", "iso Z",
          "date slash", "day time", "two columns", "ticks said", "ticks remark", "ticks bare",
          "counter", "counter and rate", "none", "none and rate")  # fmt: skip
EXTRAS = ("temperature", "magnetometer", "quaternion", "flags", "checksum", "gps", "pressure", "voltage", "sequence")
ID_NAMES = ("ch", "port", "id", "device", "addr", "node", "sensor_id", "src", "unit", "imu")
ID_VALUES = (("0", "1"), ("1", "2"), ("L", "R"), ("0x68", "0x69"), ("104", "105"), ("imu_a", "imu_b"))
WRITINGS = ("table",) * 11 + ("json", "json lines", "json columns", "json nested", "labelled", "labelled groups",
            "labelled lines", "fixed", "no names", "no names")  # fmt: skip


@dataclass(frozen=True)
class Layout:
    clock: str
    clock_unit_said: bool
    force_unit: str
    rate_unit: str
    spelt: tuple[str, str]
    units: str  # where the units are written: names, row, remark, nowhere
    bracket: str
    language: str
    names: tuple[str, str]
    time_name: str
    order: str
    extras: tuple[str, ...]
    devices: str
    writing: str
    separator: str
    comma: bool
    remark: str
    rate_hz: float
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def open_for(self) -> tuple[str, ...]:
        """What nobody can know from this text."""
        clockless = self.clock in ("none", "counter", "ticks bare")
        rare = self.units == "nowhere" and (self.force_unit == "cm/s2" or self.rate_unit in ("deg/h", "rpm"))
        unnamed = self.writing == "no names" and bool(self.extras)
        several = self.devices != "one"
        asked = {"clock": clockless, "devices": several, "units": rare, "names": unnamed}
        return tuple(what for what, is_open in asked.items() if is_open)

    def answers(self) -> dict[str, Any]:
        """What a user says when asked: the options of `trihedron.read` that close the layout."""
        made: dict[str, Any] = {}
        if "clock" in self.open_for and self.clock != "ticks bare":
            made["rate_hz"] = self.rate_hz
        if self.clock == "ticks bare":
            made["time_unit"] = self.options["tick"]
        if self.devices not in ("one", "columns"):
            marked = self.devices in ("id column", "blocks", "bursts")
            made["instance"] = self.options["values"][0] if marked else 1
        if "names" in self.open_for:
            made["columns"] = self.options["columns"]
        if self.units == "nowhere":
            made["accelerometer_unit"] = FORCE_UNITS[self.force_unit][2]
            made["gyroscope_unit"] = RATE_UNITS[self.rate_unit][2]
        return made


def pick(rng: Rng, of: Any) -> Any:
    return of[int(rng.integers(len(of)))]


def draw(rng: Rng) -> Layout:
    """One layout, each property for itself; what a writer would never do together is not drawn together."""
    language = pick(rng, ["en"] * 7 + ["pqr", "de", "fr", "es", "zh"])
    force = pick(rng, ["m/s2"] * 4 + ["g"] * 3 + ["mg", "cm/s2"] + [u for u in FORCE_UNITS if "LSB" in u])
    physical = ["rad/s"] * 3 + ["deg/s"] * 3 + ["mdps", "mrad/s", "deg/h", "rpm"]
    rate = pick(rng, [u for u in RATE_UNITS if "LSB" in u] if "LSB" in force else physical)
    devices = pick(rng, ["one"] * 24 + ["id column", "same times", "5 ms apart", "blocks", "bursts", "columns"])
    writing = pick(rng, WRITINGS) if devices == "one" else "table"
    clock, separator = pick(rng, CLOCKS), pick(rng, [",", ",", ",", ";", ";", "\t", " ", ", "])
    units = pick(rng, ["names", "names", "row", "remark", "nowhere", "nowhere"])
    if writing != "table":
        units = pick(rng, ["names", "nowhere"]) if writing in ("json", "json lines", "json columns") else "nowhere"
    language = "en" if writing in ("json nested", "labelled groups", "labelled lines", "no names") else language
    spaced = separator == " " or writing.startswith("labelled") or writing == "fixed"
    close = ["({})", "[{}]", "_{}"]
    bracket = pick(rng, close if spaced else [*close, " [{}]", " ({})", " {}", " / {}"])
    return Layout(
        clock, bool(rng.random() < 0.6), force, rate,
        (pick(rng, FORCE_UNITS[force][1]), pick(rng, RATE_UNITS[rate][1])),
        units, bracket, language, pick(rng, NAMES[language]), pick(rng, TIME_NAMES[language]),
        pick(rng, ["time first"] * 4 + ["gyro first", "time last", "by axis", "extras between"]),
        tuple(str(e) for e in rng.choice(EXTRAS, int(rng.integers(0, 4)), replace=False)), devices, writing, separator,
        bool(separator in (";", "\t") and writing == "table" and language in ("de", "fr", "es") and rng.random() < 0.8),
        pick(rng, ["", "", "", "# ", "% ", "// "]), float(pick(rng, [50, 59.5, 75, 100, 104, 119])),
        {"tick": pick(rng, list(TICKS)), "id": pick(rng, ID_NAMES), "values": pick(rng, ID_VALUES)},
    )  # fmt: skip


@dataclass(frozen=True)
class Session:
    """One part's raw readings in SI: time (n,) [s], specific force (n, 3), rate (n, 3); S (3, 3) of both sensors."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    s_force: np.ndarray
    s_rate: np.ndarray


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
    """Rows of two devices in one stream, with a column that tells them apart where the layout has one."""
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


def outcome(path: Path, of: Layout, parts: list[Session], **options: Any) -> tuple[str, str]:
    """ "right", "wrong", "doubted" (calibrated, but not to be trusted) or "asked", with the reason."""
    try:
        recording = trihedron.read(path, **options)
        result = trihedron.calibrate(recording, gravity_m_s2=G)
    except ValueError as why:
        return "asked", str(why)
    made = result.calibration
    if made.accelerometer is None or made.gyroscope is None:
        return "asked", "one sensor only"
    sizes = FORCE_UNITS[of.force_unit][0], RATE_UNITS[of.rate_unit][0]
    worst, what = np.inf, ""
    for part in parts:
        off, said = 0.0, ""
        for name, sensor, true, size in (("accelerometer", made.accelerometer, part.s_force, sizes[0]),
                                         ("gyroscope", made.gyroscope, part.s_rate, sizes[1])):  # fmt: skip
            # S is given per number of the file; body frame: X of the accelerometer and lower, as the truth was drawn.
            error = np.abs(np.asarray(sensor.S) / size - true) / np.maximum(0.02, 6 * np.asarray(sensor.sigma_S) / size)
            if error.max() > off:
                off, said = float(error.max()), f"{name} S {np.diag(sensor.S) / size}"
        if off < worst:
            worst, what = off, said
    if worst <= 1:
        wanted = FORCE_UNITS[of.force_unit][2], RATE_UNITS[of.rate_unit][2]
        units = recording.accelerometer_unit.value, recording.gyroscope_unit.value
        for unit, right in zip(units, wanted, strict=True):
            is_left_open = unit == "counts" and (of.units == "nowhere" or "ADC" in of.names[1])
            is_doubted = FindingCode.UNIT_ASSUMED in {f.code for f in recording.findings} and of.units == "nowhere"
            if unit != right and not is_left_open and not is_doubted:
                worst, what = 2.0, f"unit {unit} for {right}"
        short = len(recording.time_s) < 0.98 * len(parts[0].time_s)
        worst, what = (3.0, f"{len(recording.time_s)} of {len(parts[0].time_s)} rows") if short else (worst, what)
    if made.is_trustworthy:
        return ("wrong", what) if worst > 1 else ("right", "")
    found = (*recording.findings, *made.findings, *result.findings)
    serious = {f.code.value for f in found if f.severity.name == "SERIOUS"}
    return "doubted", ("" if worst <= 1 else f"and wrong ({what}); ") + "; ".join(sorted(serious))


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("count", type=int, nargs="?", default=100)
    arguments.add_argument("seed", type=int, nargs="?", default=1)
    arguments.add_argument("--only", type=int, help="this number alone")
    arguments.add_argument("--keep", type=Path, help="keep every file that was not right, here")
    said = arguments.parse_args()
    warnings.simplefilter("ignore")
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for k in range(said.count) if said.only is None else [said.only]:
            rng = np.random.default_rng([said.seed, k])
            of = draw(rng)
            parts = [session(rng, of.rate_hz) for _ in range(1 if of.devices == "one" else 2)]
            path = (said.keep or Path(folder)) / f"log{k}{'.jsonl' if of.writing == 'json lines' else '.csv'}"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text(of, parts, rng), encoding="utf-8")
            answer, why = outcome(path, of, parts)
            kind = "open" if of.open_for else "told"
            tally[f"{kind} {answer}"] += 1
            if kind == "open" and answer != "right":
                first, first_why = answer, why
                answer, why = outcome(path, of, parts, **of.answers())
                tally[f"answered {answer}"] += 1
                why = f"{first} ({first_why[:150]}) THEN {why}"
                answer = first if first == "wrong" else answer
            if answer != "right":
                print(k, kind, answer, why[:500], "\n   ", *(f"{a}={v}" for a, v in vars(of).items()), flush=True)
            else:
                path.unlink()
    told = sum(v for key, v in tally.items() if key.startswith("told"))
    wrong = sum(v for key, v in tally.items() if key.endswith("wrong"))
    print(dict(sorted(tally.items())))
    print(f"{said.count} layouts: {wrong} wrong with confidence; of {told} that say enough {tally['told right']} right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
