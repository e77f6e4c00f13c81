"""Layouts of a log drawn at random, without regard to what the reader knows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

G = 9.80665
DEG = np.pi / 180
Rng = np.random.Generator

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
