"""Layouts drawn at random through `calibrate`: how many end as a confident wrong calibration, how many need no
question.

    python benches/formats/drawn.py [COUNT] [SEED] [--keep FOLDER]

One session of known truth is written as clock x unit x names x order x extras x devices x language x writing, drawn
without regard to what the reader knows. *Wrong* is a calibration that is called trustworthy and whose S leaves the
truth by more than 2 % and six standard uncertainties. A layout is *open* where its text leaves
out what nobody can know: no clock or ticks of an unstated size, two devices, an unstated scale that motion alone
cannot settle. There a question is the right answer, and a right calibration is welcome.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import warnings
from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import trihedron

G = 9.80665
POSE_S, TURN_S = 2.5, 1.5
START = datetime(2025, 5, 6, 9, 41, 7, 250000, UTC)
# Size of one unit in m/s^2 or rad/s, and how a header spells it.
FORCE_UNITS = {
    "m/s2": (1.0, ["m/s^2", "m/s2", "m/s²", "m.s-2", "ms-2"]),
    "g": (9.80665, ["g", "G", "gn", "g0"]),
    "mg": (9.80665e-3, ["mg", "milli-g"]),
    "cm/s2": (0.01, ["cm/s^2", "cm/s2"]),
    "counts": (9.80665 / 4096, ["LSB", "counts", "raw"]),
}
RATE_UNITS = {
    "rad/s": (1.0, ["rad/s", "rad.s-1", "rads/s"]),
    "deg/s": (np.pi / 180, ["deg/s", "dps", "°/s"]),
    "mdps": (np.pi / 180e3, ["mdps", "mdeg/s"]),
    "mrad/s": (1e-3, ["mrad/s"]),
    "deg/h": (np.pi / 180 / 3600, ["deg/h", "°/h"]),
    "rpm": (np.pi / 30, ["rpm"]),
    "counts": (np.pi / 180 / 16.4, ["LSB", "counts", "raw"]),
}
# Accelerometer and gyroscope names of axis a, by language; {u} is lower case, {U} upper case.
NAMES = {
    "en": [
        ("a{u}", "g{u}"), ("acc_{u}", "gyr_{u}"), ("Acc{U}", "Gyro{U}"), ("accel_{u}", "omega_{u}"), ("a{u}", "w{u}"),
        ("accelerometer {U}", "gyroscope {U}"), ("Acceleration {U}", "Angular velocity {U}"), ("{u}acc", "{u}gyro"),
        ("imu0_a{u}", "imu0_g{u}"), ("linear_acceleration.{u}", "angular_velocity.{u}"), ("A{U}", "G{U}"),
        ("specific force {u}", "angular rate {u}"), ("f_{u}", "w_{u}"), ("ACC.{U}", "GYR.{U}"),
        ("Accel.{u}", "Rot.{u}"), ("{U}-axis acceleration", "{U}-axis rotation rate"),
        ("sensor_acc[{u}]", "sensor_gyr[{u}]"),
    ],
    "de": [
        ("Beschleunigung {U}", "Drehrate {U}"), ("Beschl_{u}", "Dreh_{u}"),
        ("Beschleunigung_{U}", "Winkelgeschwindigkeit_{U}"),
    ],
    "fr": [("Accélération {U}", "Vitesse angulaire {U}"), ("accélération_{u}", "gyroscope_{u}")],
    "es": [("Aceleración {U}", "Velocidad angular {U}"), ("acel_{u}", "giro_{u}")],
    "it": [("Accelerazione {U}", "Velocità angolare {U}")],
    "pt": [("Aceleração {U}", "Velocidade angular {U}")],
    "nl": [("Versnelling {U}", "Hoeksnelheid {U}")],
    "ru": [("Ускорение {U}", "Угловая скорость {U}")],
    "zh": [("加速度{U}", "角速度{U}")],
    "ja": [("加速度 {U}", "角速度 {U}")],
    "pl": [("Przyspieszenie {U}", "Prędkość kątowa {U}")],
}  # fmt: skip
TIME_NAMES = {
    "en": ["time", "t", "Timestamp", "Time"], "de": ["Zeit"], "fr": ["Temps"], "es": ["Tiempo"], "it": ["Tempo"],
    "pt": ["Tempo"], "nl": ["Tijd"], "ru": ["Время"], "zh": ["时间"], "ja": ["時間"], "pl": ["Czas"],
}  # fmt: skip
CLOCKS = (
    "s", "s", "ms", "ms", "us", "us", "ns", "epoch s", "epoch ms", "epoch us", "epoch ns", "iso", "iso zone",
    "day time", "local date", "sec nsec", "gps week", "steps", "wrap 16 ms", "wrap 32 us", "counter and rate",
    "date and time", "ticks named", "ticks bare", "counter", "none", "host and board",
)  # fmt: skip
EXTRAS = (
    "temperature", "magnetometer", "quaternion", "euler", "pressure", "battery", "status", "count", "label", "position",
    "free acceleration", "zeros", "norm", "checksum", "velocity",
)  # fmt: skip


@dataclass(frozen=True)
class Layout:
    clock: str
    clock_unit_said: bool
    force_unit: str
    rate_unit: str
    units: str  # where the units are written: "names", "row", "remark", "nowhere"
    bracket: str
    language: str
    name_force: str
    name_rate: str
    order: str
    axes: str
    extras: tuple[str, ...]
    devices: str
    writing: str
    separator: str
    comma: bool
    preamble: bool
    rate_hz: float

    @property
    def is_open(self) -> bool:
        """A question is the right answer: the text does not hold what a calibration needs."""
        no_clock = self.clock in ("none", "counter", "ticks bare")
        silent = self.units == "nowhere" and (self.force_unit == "cm/s2" or self.rate_unit in ("deg/h", "rpm"))
        counted = self.rate_unit == "counts" and self.clock == "steps" and not self.clock_unit_said
        return no_clock or self.devices != "one" or silent or counted


def draw(rng: np.random.Generator) -> Layout:
    """One layout, each property for itself; what a writer would never do together is not drawn together."""
    pick = lambda of: of[int(rng.integers(len(of)))]  # noqa: E731
    language = pick(["en"] * 6 + [k for k in NAMES if k != "en"])
    force, rate = pick(NAMES[language])
    force_unit = pick(["m/s2"] * 4 + ["g"] * 3 + ["mg", "cm/s2", "counts", "counts"])
    rate_unit = (
        "counts" if force_unit == "counts" else pick(["rad/s"] * 3 + ["deg/s"] * 3 + ["mdps", "mrad/s", "deg/h", "rpm"])
    )
    devices = pick(["one"] * 8 + ["alternating", "columns", "same times"])
    writing = pick(["table"] * 9 + ["json lines", "labelled"]) if devices == "one" else "table"
    separator = pick([",", ",", ";", "\t", "  ", ", "])
    return Layout(
        clock=pick(CLOCKS), clock_unit_said=bool(rng.random() < 0.5), force_unit=force_unit, rate_unit=rate_unit,
        units=pick(["names", "names", "row", "remark", "nowhere", "nowhere"]) if writing == "table" else "nowhere",
        bracket=pick([" [{}]", " ({})", "[{}]", "_{}", "({})", " in {}"]), language=language, name_force=force,
        name_rate=rate, order=pick(["time first"] * 4 + ["gyro first", "time last", "by axis", "extras between"]),
        axes=pick(["xyz"] * 6 + ["zyx", "yxz"]),
        extras=tuple(rng.choice(EXTRAS, int(rng.integers(0, 4)), replace=False)), devices=devices, writing=writing,
        separator=separator,
        comma=bool(separator in (";", "\t") and language not in ("en", "zh", "ja") and rng.random() < 0.7),
        preamble=bool(rng.random() < 0.25), rate_hz=float(pick([50.0, 100.0, 104.0, 128.0, 200.0, 256.0])),
    )  # fmt: skip


@dataclass(frozen=True)
class Session:
    """One part's readings in SI, raw: time (n,) [s], specific force (n, 3), rate (n, 3); truth S (3, 3) of both
    sensors, SI per raw SI."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    s_force: np.ndarray
    s_rate: np.ndarray


def session(rng: np.random.Generator, rate_hz: float, n_poses: int = 18) -> Session:
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


def clock_columns(of: Layout, t: np.ndarray, rng: np.random.Generator) -> dict[str, list[str]]:
    """Columns of time by name, as a logger of this kind writes them."""
    name = TIME_NAMES[of.language][int(rng.integers(len(TIME_NAMES[of.language])))]
    unit = lambda u: name + (of.bracket.format(u) if of.clock_unit_said else "")  # noqa: E731
    whole = lambda x: [str(v) for v in np.rint(x).astype(np.int64)]  # noqa: E731
    utc, epoch = [START + timedelta(seconds=float(x)) for x in t], START.timestamp()
    count = np.arange(len(t))
    match of.clock:
        case "s":
            return {unit("s"): [f"{x:.5f}" for x in t + rng.choice([0.0, 12.75, 8123.4])]}
        case "ms" | "us" | "ns":
            per_s = {"ms": 1e3, "us": 1e6, "ns": 1e9}[of.clock]
            return {unit(of.clock): whole((t + rng.choice([0.0, 3.217, 912.3])) * per_s)}
        case "epoch s":
            return {unit("s"): [f"{epoch + x:.6f}" for x in t]}
        case "epoch ms" | "epoch us" | "epoch ns":
            per_s = {"ms": 10**3, "us": 10**6, "ns": 10**9}[of.clock[6:]]
            return {unit(of.clock[6:]): [str(round(epoch * 1e3) * per_s // 1000 + round(x * per_s)) for x in t]}
        case "iso":
            return {name: [f"{x:%Y-%m-%dT%H:%M:%S.%f}"[:-3] for x in utc]}
        case "iso zone":
            return {name: [f"{x:%Y-%m-%d %H:%M:%S.%f}+02:00" for x in utc]}
        case "day time":
            return {name: [f"{x:%H:%M:%S.%f}"[:-3] for x in utc]}
        case "local date":
            return {name: [f"{x:%d.%m.%Y %H:%M:%S.%f}"[:-3] for x in utc]}
        case "date and time":
            return {"date": [f"{x:%Y-%m-%d}" for x in utc], "time": [f"{x:%H:%M:%S.%f}" for x in utc]}
        case "sec nsec":
            ns = np.rint((t + 0.4) * 1e9).astype(np.int64)
            return {"sec": [str(int(epoch) + v // 10**9) for v in ns], "nanosec": [str(v % 10**9) for v in ns]}
        case "gps week":
            return {"gps_week": ["2365"] * len(t), "tow_s": [f"{204067.25 + x:.4f}" for x in t]}
        case "steps":
            step = np.diff(np.rint(t * 1e6), prepend=-1e6 / of.rate_hz)
            return {"dt" + (of.bracket.format("us") if of.clock_unit_said else "_us"): whole(step)}
        case "wrap 16 ms":
            return {unit("ms"): whole(np.rint(t * 1e3 + 41000) % 65536)}
        case "wrap 32 us":
            return {unit("us"): whole(np.rint(t * 1e6 + 2**32 - 2e7) % 2**32)}
        case "counter and rate" | "counter":
            return {str(rng.choice(["sample", "counter", "Packet", "index", "n"])): whole(count)}
        case "ticks named":
            return {"ticks" + of.bracket.format("1/32768 s"): whole(t * 32768)}
        case "ticks bare":
            return {name: whole(t * rng.choice([32768.0, 4e4, 25600.0, 16000.0]) + rng.choice([0, 71234]))}
        case "host and board":
            late = np.sort(t + rng.exponential(0.004, len(t)))
            return {"host_time": [f"{epoch + x:.6f}" for x in late], "device_us": whole(t * 1e6 + 5e6)}
    return {}


def extra_columns(of: Layout, made: Session, rng: np.random.Generator) -> dict[str, list[str]]:
    """Columns of other sensors and of bookkeeping, with values as such columns have them."""
    t, n = made.time_s, len(made.time_s)
    pose = np.cumsum(0.02 * rng.standard_normal((n, 4)), 0) / 5 + rng.standard_normal(4)
    table: dict[str, dict[str, np.ndarray]] = {
        "temperature": {str(rng.choice(["temp", "Temperature [°C]", "T_C", "die temp"])): 24 + 0.01 * t},
        "magnetometer": dict(zip(["mag_x", "mag_y", "mag_z"], (4.8 * made.force).T, strict=True)),
        "quaternion": dict(
            zip(["q0", "q1", "q2", "q3"], (pose / np.linalg.norm(pose, axis=1)[:, None]).T, strict=True)
        ),
        "euler": dict(zip(["roll", "pitch", "yaw"], np.degrees(pose[:, :3]).T, strict=True)),
        "pressure": {"baro_hPa": 1003 + 0.05 * rng.standard_normal(n)},
        "battery": {"vbat": 3.9 - 1e-4 * t},
        "status": {"status": np.full(n, 7.0)},
        "count": {str(rng.choice(["seq", "pkt", "No."])): np.arange(n) % 256.0},
        "position": {"lat": 59.93 + 1e-6 * t, "lon": 30.31 + 1e-6 * t},
        "free acceleration": dict(zip(["lin_x", "lin_y", "lin_z"], 0.05 * rng.standard_normal((3, n)), strict=True)),
        "zeros": {"aux1": np.zeros(n), "aux2": np.zeros(n)},
        "norm": {"acc_norm": np.linalg.norm(made.force / FORCE_UNITS[of.force_unit][0], axis=1)},
        "velocity": dict(zip(["vel_n", "vel_e", "vel_d"], 0.01 * rng.standard_normal((3, n)), strict=True)),
    }
    out: dict[str, list[str]] = {}
    for kind in of.extras:
        if kind == "label":
            out["activity"] = ["bench"] * n
        elif kind == "checksum":
            out["crc"] = [f"0x{v:04X}" for v in rng.integers(0, 65536, n)]
        else:
            out |= {name: [f"{x:.7g}" for x in column] for name, column in table[kind].items()}
    return out


def readings(of: Layout, made: Session, prefix: str, spell: tuple[str, str]) -> tuple[dict[str, list[str]], ...]:
    """Columns of the accelerometer and of the gyroscope, axis by axis, in the layout's units."""
    out = []
    for name, unit, said, values, table in (
        (of.name_force, of.force_unit, spell[0], made.force, FORCE_UNITS),
        (of.name_rate, of.rate_unit, spell[1], made.rate, RATE_UNITS),
    ):
        form = prefix + name + (of.bracket.format(said) if of.units == "names" else "")
        scaled = values / table[unit][0]
        column = lambda x, unit=unit: [f"{v:.0f}" if unit == "counts" else f"{v:.7g}" for v in x]  # noqa: E731
        out.append({form.format(u=a, U=a.upper()): column(scaled[:, "xyz".index(a)]) for a in of.axes})
    return tuple(out)


def text(of: Layout, parts: list[Session], rng: np.random.Generator) -> str:
    """The file's text."""
    spell = (str(rng.choice(FORCE_UNITS[of.force_unit][1])), str(rng.choice(RATE_UNITS[of.rate_unit][1])))
    first = parts[0]
    clock, extras = clock_columns(of, first.time_s, rng), extra_columns(of, first, rng)
    force, rate = readings(of, first, "left " if of.devices == "columns" else "", spell)
    if of.order == "by axis":
        sensors = {k: v for pair in zip(force.items(), rate.items(), strict=True) for k, v in pair}
    else:
        sensors = rate | force if of.order == "gyro first" else force | rate
    if of.devices == "columns":
        sensors |= {k: v for half in readings(of, parts[1], "right ", spell) for k, v in half.items()}
    middle = extras | sensors if of.order == "extras between" else sensors | extras
    table = middle | clock if of.order == "time last" else clock | middle
    units = dict.fromkeys(force, spell[0]) | dict.fromkeys(rate, spell[1])
    rows = list(zip(*table.values(), strict=True))
    names = list(table)
    if of.devices in ("alternating", "same times"):
        theirs = [column for half in readings(of, parts[1], "", spell) for column in half.values()]
        seconds = table | dict(zip([*force, *rate], theirs, strict=True))
        other = list(zip(*seconds.values(), strict=True))
        if of.devices == "alternating":
            mark = str(rng.choice(["id", "ch", "port", "sensor", "node"]))
            names = [mark, *names]
            rows = [(str(k + 1), *row) for pair in zip(rows, other, strict=True) for k, row in enumerate(pair)]
        else:
            rows = [row for pair in zip(rows, other, strict=True) for row in pair]
    if of.writing == "json lines":
        number = lambda v: float(v) if v.lstrip("-").replace(".", "", 1).replace("e-", "", 1).isdigit() else v  # noqa: E731
        return "".join(
            json.dumps(dict(zip(names, map(number, r), strict=True)), ensure_ascii=False) + "\n" for r in rows
        )
    if of.writing == "labelled":
        return "".join(
            " ".join(f"{k.replace(' ', '_')}:{v}" for k, v in zip(names, r, strict=True)) + "\n" for r in rows
        )
    head = ""
    if of.preamble:
        head += "# Logger v2.1\n# Serial: 00B43A\n"
    if of.units == "remark":
        head += f"# accelerometer in {spell[0]}, gyroscope in {spell[1]}\n"
    if of.clock == "counter and rate":
        head += f"# Sample rate: {of.rate_hz:g} Hz\n"
    lines = [names]
    if of.units == "row":
        of_time = of.clock if of.clock in ("s", "ms", "us", "ns") else "-"
        lines.append([units.get(k, of_time if k in clock else "-") for k in names])
    point = (lambda v: v.replace(".", ",") if v.replace(".", "", 1).lstrip("-").isdigit() else v) if of.comma else str
    lines += [[point(v) for v in row] for row in rows]
    return head + "".join(of.separator.join(line) + "\n" for line in lines)


def verdict(path: Path, of: Layout, truth: Session) -> tuple[str, str]:
    """ "right", "wrong", "doubted" (calibrated, but not to be trusted) or "asked", with the reason."""
    try:
        result = trihedron.calibrate(path, gravity_m_s2=G)
    except ValueError as why:
        return "asked", str(why)
    made = result.calibration
    trusted = made.is_trustworthy
    if made.accelerometer is None or made.gyroscope is None:
        return "asked", "one sensor only"
    worst, what = 0.0, ""
    for name, sensor, true, unit in (
        ("accelerometer", made.accelerometer, truth.s_force, FORCE_UNITS[of.force_unit][0]),
        ("gyroscope", made.gyroscope, truth.s_rate, RATE_UNITS[of.rate_unit][0]),
    ):
        # Body frame: lower along X of the accelerometer for both, as the truth was drawn.
        off = np.abs(np.asarray(sensor.S) / unit - true) / np.maximum(0.02, 6 * np.asarray(sensor.sigma_S) / unit)
        if off.max() > worst:
            worst, what = float(off.max()), f"{name} S {np.diag(sensor.S) / unit}"
    if trusted:
        return ("wrong", what) if worst > 1 else ("right", "")
    serious = [f.code for f in (*made.findings, *result.findings) if f.severity.name == "SERIOUS"]
    return "doubted", ("" if worst <= 1 else f"and wrong ({what}); ") + "; ".join(serious)[:300]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
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
            answer, why = verdict(path, of, parts[0])
            tally[f"{'open' if of.is_open else 'told'} {answer}"] += 1
            if answer == "wrong" or (answer != "right" and not of.is_open):
                print(k, answer, why[:400], "\n   ", *(f"{a}={v}" for a, v in vars(of).items()), flush=True)
            else:
                path.unlink()
    told = sum(v for key, v in tally.items() if key.startswith("told"))
    wrong = sum(v for key, v in tally.items() if key.endswith("wrong"))
    print(dict(sorted(tally.items())))
    print(f"{said.count} layouts: {wrong} wrong with confidence; of {told} that say enough {tally['told right']} right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
