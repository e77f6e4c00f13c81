"""Layouts drawn at random through `calibrate`: how many end as a confident wrong calibration, how many need no
question.

    python benches/formats/drawn.py [COUNT] [SEED] [--keep FOLDER]

One session of known S and b is written as clock x unit x names x order x extras x devices x language x container say.
*Wrong* is a calibration
that is called trustworthy and whose S differs from the truth by more than 2 % and six standard uncertainties. *Open*
layouts leave out what
nobody can know (ticks of an unstated size beside a gyro in counts, no clock, unnamed units of their own): there a
question is the right answer.
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
from time import perf_counter

import numpy as np
from scipy.spatial.transform import Rotation

import trihedron

G = 9.80665
EPOCH_S = 1_700_000_000.0
POSE_S, TURN_S = 2.5, 1.5
ACCEL_UNITS = {
    "m/s^2": (1.0, ("m/s^2", "m/s2", "m/s²", "m.s-2", "ms-2")),
    "g": (G, ("g", "G", "g0")),
    "mg": (1e-3 * G, ("mg", "milli-g")),
    "cm/s^2": (1e-2, ("cm/s^2", "cm/s2", "Gal")),
    "counts": (None, ("LSB", "raw", "counts", "ADC")),
}
GYRO_UNITS = {
    "rad/s": (1.0, ("rad/s", "rad.s-1", "rads")),
    "deg/s": (np.pi / 180, ("deg/s", "dps", "°/s")),
    "mdps": (1e-3 * np.pi / 180, ("mdps", "mdeg/s")),
    "mrad/s": (1e-3, ("mrad/s",)),
    "rpm": (2 * np.pi / 60, ("rpm", "RPM")),
    "deg/h": (np.pi / 180 / 3600, ("deg/h", "°/h", "dph")),
    "counts": (None, ("LSB", "raw", "counts", "ADC")),
}
NAMES = {
    "short": "ax ay az gx gy gz",
    "acc_x": "acc_x acc_y acc_z gyr_x gyr_y gyr_z",
    "AccX": "AccX AccY AccZ GyrX GyrY GyrZ",
    "accel": "accel_x accel_y accel_z gyro_x gyro_y gyro_z",
    "words": "Accelerometer X;Accelerometer Y;Accelerometer Z;Gyroscope X;Gyroscope Y;Gyroscope Z",
    "mavlink": "xacc yacc zacc xgyro ygyro zgyro",
    "rot": "accX accY accZ rotX rotY rotZ",
    "pqr": "ax ay az p q r",
    "imu0": "imu0_ax imu0_ay imu0_az imu0_gx imu0_gy imu0_gz",
    "ros": "linear_acceleration.x linear_acceleration.y linear_acceleration.z"
    " angular_velocity.x angular_velocity.y angular_velocity.z",
    "omega": "fx fy fz wx wy wz",
    "numbers": "acc1 acc2 acc3 gyro1 gyro2 gyro3",
    "de": "Beschleunigung X;Beschleunigung Y;Beschleunigung Z;Drehrate X;Drehrate Y;Drehrate Z",
    "fr": "Accélération X;Accélération Y;Accélération Z;Gyroscope X;Gyroscope Y;Gyroscope Z",
    "es": "Aceleración X;Aceleración Y;Aceleración Z;Giroscopio X;Giroscopio Y;Giroscopio Z",
    "it": "Accelerazione X;Accelerazione Y;Accelerazione Z;Giroscopio X;Giroscopio Y;Giroscopio Z",
    "pl": "Przyspieszenie X;Przyspieszenie Y;Przyspieszenie Z;Żyroskop X;Żyroskop Y;Żyroskop Z",
    "ru": "Ускорение X;Ускорение Y;Ускорение Z;Гироскоп X;Гироскоп Y;Гироскоп Z",
    "zh": "加速度X;加速度Y;加速度Z;角速度X;角速度Y;角速度Z",
    "ja": "加速度X;加速度Y;加速度Z;ジャイロX;ジャイロY;ジャイロZ",
    "none": "",
}
CLOCKS = {
    "seconds": "t time Time timestamp time_s t[s]",
    "seconds3": "t time Time_s",
    "ms": "ms time_ms millis t timestamp Timestamp(ms)",
    "us": "us time_us micros timestamp ustime t",
    "epoch ns": "timestamp #timestamp[ns] ns time",
    "epoch s": "time timestamp epoch unix_time",
    "epoch ms": "time timestamp epoch_ms",
    "iso": "time timestamp date Timestamp",
    "of day": "time Time clock",
    "ms wrapping": "ms t time",
    "us wrapping": "us micros timestamp",
    "32768 Hz": "ticks timestamp t time clk",
    "25 us": "ticks timestamp SensorTime tick",
    "39.0625 us": "timestamp sensortime ticks time",
    "62.5 us": "timestamp ticks t",
    "counter": "counter n sample idx packet seq t",
    "counter, rate said": "sample n",
    "none": "-",
}
TICKS = {"32768 Hz": 1 / 32768, "25 us": 25e-6, "39.0625 us": 39.0625e-6, "62.5 us": 62.5e-6}
EXTRAS = (
    "temperature",
    "magnetometer",
    "counter",
    "quaternion",
    "status",
    "battery",
    "label",
    "euler",
    "free acceleration",
)
DEVICES = ("id", "same timestamps", "apart", "wide")


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


@dataclass
class Layout:
    """What was drawn, and the file."""

    clock: str
    accel_unit: str
    gyro_unit: str
    units_said: str
    names: str
    order: str
    extras: tuple[str, ...]
    devices: str
    container: str
    rate_hz: float
    accel_factor: float = 1.0
    gyro_factor: float = 1.0
    is_open: bool = False


def timestamps(clock: str, time_s: np.ndarray, rng: np.random.Generator) -> list[str]:
    start = float(rng.uniform(0, 5000))
    t = time_s + start
    if clock == "seconds":
        return [f"{x:.6f}" for x in time_s]
    if clock == "seconds3":
        return [f"{x:.3f}" for x in time_s]
    if clock in ("ms", "us"):
        return [str(round(x * (1e3 if clock == "ms" else 1e6))) for x in t]
    if clock == "epoch ns":
        return [str(int(EPOCH_S * 1e9) + round(x * 1e9)) for x in t]
    if clock == "epoch s":
        return [f"{EPOCH_S + x:.4f}" for x in t]
    if clock == "epoch ms":
        return [str(int(EPOCH_S * 1e3) + round(x * 1e3)) for x in t]
    if clock in ("iso", "of day"):
        form = "%Y-%m-%dT%H:%M:%S.%f" if clock == "iso" else "%H:%M:%S.%f"
        return [(datetime.fromtimestamp(EPOCH_S, UTC) + timedelta(seconds=float(x))).strftime(form)[:-3] for x in t]
    if clock == "ms wrapping":
        return [str(round(x * 1e3) % 65536) for x in t]
    if clock == "us wrapping":
        return [str((round(x * 1e6) + 2**32 - 30_000_000) % 2**32) for x in time_s]
    if clock in TICKS:
        return [str(round(x / TICKS[clock])) for x in t]
    first = int(rng.integers(0, 3))
    return [str(first + k) for k in range(len(t))]


def drawn(rng: np.random.Generator) -> Layout:
    def pick(options, p=None):
        return options[int(rng.choice(len(options), p=p))]

    clocks = list(CLOCKS)
    weights = np.array([1.5, 1, 2, 2, 1, 1, 1, 1, 0.5, 0.7, 0.7, 0.4, 0.4, 0.4, 0.3, 0.7, 0.5, 0.6])
    clock = pick(clocks, weights / weights.sum())
    accel = pick(list(ACCEL_UNITS), [0.3, 0.25, 0.1, 0.05, 0.3])
    gyro = "counts" if accel == "counts" else pick(list(GYRO_UNITS), [0.37, 0.37, 0.08, 0.06, 0.06, 0.06, 0.0])
    said = pick(("name_", "name()", "name[]", "row", "comment", "nowhere"), [0.15, 0.15, 0.15, 0.1, 0.1, 0.35])
    names = pick(list(NAMES))
    if names == "none" and said != "comment":
        said = "nowhere"
    container = pick(("csv", "semicolon", "tab", "jsonl", "labelled", "lines"), [0.45, 0.15, 0.15, 0.1, 0.1, 0.05])
    if container in ("jsonl", "labelled", "lines"):
        names, said = pick(("short", "accel", "AccX", "mavlink")), "nowhere"
    if container == "jsonl" and clock == "counter, rate said":
        clock = "counter"  # JSON has no place for a remark
    extras = tuple(x for x in EXTRAS if names != "none" and container == "csv" and rng.random() < 0.2)
    devices = pick(("one", *DEVICES), [0.84, 0.04, 0.04, 0.04, 0.04])
    if container in ("labelled", "lines") or names in ("none", "imu0"):
        devices = "one"
    order = pick(("time first", "time last", "gyro first", "interleaved"), [0.6, 0.12, 0.16, 0.12])
    if container == "lines" or (names == "none" and order in ("interleaved", "time last")):
        order = "time first"
    low = pick((2048.0, 4096.0, 8192.0, 16384.0))
    per = pick((16.4, 32.8, 65.5, 131.0))
    accel_factor = ACCEL_UNITS[accel][0] or G / low
    gyro_factor = GYRO_UNITS[gyro][0] or np.pi / 180 / per
    rate_hz = pick((25.0, 50.0, 100.0, 104.0, 200.0, 400.0, 500.0), [0.05, 0.2, 0.3, 0.1, 0.2, 0.1, 0.05])
    made = Layout(
        clock, accel, gyro, said, names, order, extras, devices, container, rate_hz, accel_factor, gyro_factor
    )
    no_rate = clock in ("counter", "none") or (clock in TICKS and (said == "nowhere" or gyro == "counts"))
    odd = said == "nowhere" and gyro in ("rpm", "deg/h")
    made.is_open = bool(no_rate or odd or devices != "one")
    return made


def text(layout: Layout, rng: np.random.Generator, parts: list[Session]) -> str:
    """The file of a layout; parts[0] is the one whose truth counts."""

    def pick(options):
        return options[int(rng.integers(len(options)))]

    names = NAMES[layout.names].split(";") if ";" in NAMES[layout.names] else NAMES[layout.names].split()
    unnamed = not names
    names = names or NAMES["short"].split()
    said = [pick(ACCEL_UNITS[layout.accel_unit][1])] * 3 + [pick(GYRO_UNITS[layout.gyro_unit][1])] * 3
    form = {"name_": "{}_{}", "name()": "{} ({})", "name[]": "{} [{}]"}.get(layout.units_said)
    time_name = pick(CLOCKS[layout.clock].split(" "))
    groups = {"t": [time_name], "a": [0, 1, 2], "g": [3, 4, 5]}
    order = {"time first": "tag", "time last": "agt", "gyro first": "tga"}.get(layout.order)
    columns = [c for g in order for c in groups[g]] if order else [time_name, 0, 3, 1, 4, 2, 5]
    if layout.clock == "none":
        columns = [c for c in columns if c != time_name]
    cells, rows = [], []
    for part in parts:
        values = np.c_[part.force / layout.accel_factor, part.rate / layout.gyro_factor]
        n, counts = len(values), layout.accel_unit == "counts"
        data: dict[object, list[str]] = {}
        for k in range(6):
            digits = 0 if counts else max(0, 6 - int(np.ceil(np.log10(np.abs(values[:, k]).max()))))
            data[k] = [f"{x:.{digits}f}" for x in values[:, k]]
        shift = 0.5 / layout.rate_hz if layout.devices == "apart" and cells else 0.0
        data[time_name] = timestamps(layout.clock, part.time_s + shift, np.random.default_rng(5))
        data |= extras(layout.extras, part, rng)
        cells.append(data)
        rows.append(n)
    every = [*columns, *[c for c in cells[0] if isinstance(c, str) and c != time_name]]
    title = {k: form.format(names[k], said[k]) if form else names[k] for k in range(6)}
    header = [title.get(c, c) for c in every]
    unit_row = [said[c] if isinstance(c, int) else "-" for c in every]
    if layout.devices == "wide":
        for prefix, data in zip(("imu0_", "imu1_"), cells, strict=True):
            cells[0] |= {prefix + title[k]: data[k] for k in range(6)}
        rest = [c for c in every if not isinstance(c, int)]
        every = [*rest[:1], *(p + title[k] for p in ("imu0_", "imu1_") for k in range(6)), *rest[1:]]
        header, unit_row, cells = every, [""] * len(every), cells[:1]
    elif layout.devices in ("id", "same timestamps"):
        which = pick(("id", "ch", "port", "sensor", "device", "imu"))
        for k, data in enumerate(cells):
            data[which] = [str(k)] * rows[k]
        every, header, unit_row = [*every, which], [*header, which], [*unit_row, "-"]
    lines = []
    if layout.clock == "counter, rate said":
        lines.append(f"# sampling rate: {layout.rate_hz:g} Hz")
    if layout.units_said == "comment":
        lines.append(f"# acceleration in {said[0]}, angular rate in {said[3]}")
    gap = {"semicolon": ";", "tab": "\t"}.get(layout.container, ",")
    if layout.container == "jsonl":
        body = (
            "{"
            + ", ".join(f'"{h}": {c}' if _is_number(c) else f'"{h}": "{c}"' for h, c in zip(header, line, strict=True))
            + "}"
            for line in _together(cells, every)
        )
    elif layout.container == "labelled":
        body = (" ".join(f"{h}:{c}" for h, c in zip(header, line, strict=True)) for line in _together(cells, every))
    elif layout.container == "lines":
        d = cells[0]
        stamp = [f"{x} " for x in d[time_name]] if layout.clock != "none" else [""] * rows[0]
        body = (
            f"{stamp[i]}Accel: {d[0][i]}, {d[1][i]}, {d[2][i]}\n{stamp[i]}Gyro: {d[3][i]}, {d[4][i]}, {d[5][i]}"
            for i in range(rows[0])
        )
    else:
        if not unnamed:
            lines.append(gap.join(header))
        if layout.units_said == "row":
            lines.append(gap.join(unit_row))
        comma = layout.container == "semicolon" and layout.names in ("de", "fr", "es", "it", "pl", "ru")
        body = (gap.join(line).replace(".", ",") if comma else gap.join(line) for line in _together(cells, every))
    return "\n".join([*lines, *body]) + "\n"


def _is_number(word: str) -> bool:
    return word.replace(".", "", 1).lstrip("-").isdigit()


def _together(cells: list[dict[object, list[str]]], every: list[object]):
    for i in range(len(cells[0][every[-1]])):
        for data in cells:
            yield [data[c][i] for c in every]


def extras(which: tuple[str, ...], part: Session, rng: np.random.Generator) -> dict[object, list[str]]:
    n, t = len(part.time_s), part.time_s
    made: dict[str, np.ndarray] = {}
    if "temperature" in which:
        made["temp"] = np.round(25 + 2 * (1 - np.exp(-t / 60)) + 0.02 * rng.standard_normal(n), 2)
    if "magnetometer" in which:
        made |= {
            f"mag_{a}": np.round(40 * part.force[:, k] / G + 0.3 * rng.standard_normal(n), 2)
            for k, a in enumerate("xyz")
        }
    if "counter" in which:
        made["cnt"] = np.arange(n) % 256
    if "quaternion" in which:
        q = rng.standard_normal((1, 4)) + 0.1 * np.cumsum(rng.standard_normal((n, 4)), 0) / np.sqrt(n)
        made |= {f"q{k}": np.round(q[:, k] / np.linalg.norm(q, axis=1), 5) for k in range(4)}
    if "status" in which:
        made["status"] = np.full(n, 3)
    if "battery" in which:
        made["vbat"] = np.round(3.9 - 1e-4 * t + 0.005 * rng.standard_normal(n), 3)
    if "euler" in which:
        made["roll"] = np.round(np.degrees(np.arctan2(part.force[:, 1], part.force[:, 2])), 2)
        made["pitch"] = np.round(np.degrees(np.arcsin(np.clip(-part.force[:, 0] / G, -1, 1))), 2)
    if "free acceleration" in which:
        made |= {f"lin_acc_{a}": np.round(0.05 * rng.standard_normal(n), 4) for a in "xyz"}
    out: dict[object, list[str]] = {k: [f"{x:g}" for x in v] for k, v in made.items()}
    if "label" in which:
        out["label"] = ["walk"] * n
    return out


def verdict(path: Path, layout: Layout, truth: Session) -> tuple[str, str]:
    """ "right", "wrong", "doubted" (calibrated, but not to be trusted) or "asked", with a reason."""
    try:
        result = trihedron.calibrate(path, gravity_m_s2=G)
    except ValueError as why:
        return "asked", str(why)
    made = result.calibration
    worst, what = 0.0, ""
    for name, sensor, s, factor in (
        ("accelerometer", made.accelerometer, truth.s_force, layout.accel_factor),
        ("gyroscope", made.gyroscope, truth.s_rate, layout.gyro_factor),
    ):
        if sensor is None:
            return "asked", f"no {name} recognised"
        # Frame: lower along X of the accelerometer for both, as the truth was drawn.
        off = np.abs(np.asarray(sensor.S) / factor - s)
        allowed = np.maximum(0.02, 6 * np.asarray(sensor.sigma_S) / factor)
        if (off / allowed).max() > worst:
            worst, what = float((off / allowed).max()), f"{name} S {np.diag(sensor.S) / factor}"
    if made.is_trustworthy:
        return ("wrong", what) if worst > 1 else ("right", "")
    serious = [str(f) for f in result.findings if str(getattr(f, "severity", "")) == "serious"]
    return "doubted", ("" if worst <= 1 else "and wrong; ") + "; ".join(serious)[:300]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("count", type=int, nargs="?", default=100)
    arguments.add_argument("seed", type=int, nargs="?", default=1)
    arguments.add_argument("--keep", type=Path, help="keep every file that was not right, here")
    said = arguments.parse_args()
    warnings.simplefilter("ignore")
    tally: Counter[str] = Counter()
    start = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for k in range(said.count):
            rng = np.random.default_rng([said.seed, k])
            layout = drawn(rng)
            parts = [session(rng, layout.rate_hz) for _ in range(1 if layout.devices == "one" else 2)]
            content = text(layout, rng, parts)
            path = Path(folder) / f"log{k}{'.jsonl' if layout.container == 'jsonl' else '.csv'}"
            path.write_text(content, encoding="utf-8")
            answer, why = verdict(path, layout, parts[0])
            tally[f"{'open' if layout.is_open else 'told'} {answer}"] += 1
            if answer == "wrong" or (answer != "right" and not layout.is_open):
                drawn_as = {key: v for key, v in vars(layout).items() if v not in ("one", (), [], {}, False)}
                print(
                    k,
                    answer,
                    why[:400],
                    "\n   ",
                    json.dumps(drawn_as, default=str)[:400],
                    "\n   ",
                    content[:160].replace("\n", " | "),
                    flush=True,
                )
            if said.keep and (answer == "wrong" or (answer != "right" and not layout.is_open)):
                said.keep.mkdir(exist_ok=True)
                (said.keep / path.name).write_bytes(path.read_bytes())
            path.unlink()
    told = sum(v for key, v in tally.items() if key.startswith("told"))
    wrong = sum(v for key, v in tally.items() if key.endswith("wrong"))
    print(dict(sorted(tally.items())), f"{perf_counter() - start:.0f} s")
    print(f"{said.count} layouts: {wrong} wrong with confidence")
    print(f"of {told} that say enough, {tally['told right']} right without a question")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
