"""The meaning of a column name, as common loggers write it."""

import re
from dataclasses import dataclass, replace
from functools import lru_cache

from trihedron.read.clock.unit import seconds_of
from trihedron.read.languages import english, plain

_WORD = re.compile(r"(?:[^\W_²³¹]|°)+")
_CAMEL = re.compile(r"([a-z])([A-Z])")
_NOT_A_SENSOR = frozenset(
    {"cov", "covariance", "std", "stddev", "sigma", "var", "bias", "offset", "integral", "dt", "euler", "orientation"}
    | {"quaternion", "quat", "mag", "magnetometer", "magnetic", "gravity", "clipping", "clip", "samples", "sat", "flag"}
    | {"status", "heading", "delta", "id", "count", "error", "drift"}
)
_SENSOR_WORDS = {
    "accelerometer": re.compile(r"acc\d*|acce|accl|accel\w*|acceler\w*|specific|specificforce|spec|sf|xl"),
    "gyroscope": re.compile(
        r"gyr\d*|gyro\w*|angular|omega|om|rot|rotation|rotationrate|angvel|angrate|rotrate|av|angularvelocity|rate"
    ),
}
_LETTER = {"a": "accelerometer", "f": "accelerometer", "g": "gyroscope", "w": "gyroscope", "t": "translation"}
_DEVICE_WORDS = r"(?:imu|dev|device|sensor|node|unit|port|ch|mpu|bmi|icm|lsm)\d*"
_DEVICE_WORD = re.compile(f"{_DEVICE_WORDS}$")
_GLUED = tuple(
    (re.compile(pattern), by)
    for pattern, by in (
        (
            r"\b(accelero?(?:meter)?|acceleration|acc|gyro?|gyroscope|omega|linacc)([xyz])(raw|adc)?(?:out)?\b",
            r"\1 \2 \3",
        ),
        (rf"^((?:{_DEVICE_WORDS} )*[agwft])([xyz])(raw|adc)?(?:out)?\b", r"\1 \2 \3"),
        # Axis before the sensor, as MAVLink writes it: xacc, ygyro.
        (r"\b([xyz])(acc|accel|accelerometer|acceleration|gyro?|gyroscope|rate)\b", r"\2 \1"),
        (r"^(?!.*\b[xyz]\b)(.*\b(?:acc|accel|gyro?|omega))([0-3])\b", r"\1 \2"),
        (r"\b([xyz])out\b", r"\1"),
    )
)
"""Words in which a sensor and an axis are joined, and the same words apart; the first that fits is replaced."""
_SPELLINGS = (
    (r"m/\((?:s|sec)\^2\)", "m/s^2"),
    (r"^gF([xyz])$", r"raw specific \1 [g]"),  # Physics Toolbox: force in g along an axis; the g does not mean gyro
    (r"^N(?=[xyz](?![A-Za-z]))", "acc "),  # load factors in aeronautics, logged with p q r
    (r"^Ac(?=[XYZ](?![A-Za-z]))", "acc"),  # the common Arduino sketch for MPU-6050 boards: AcX, GyX
    (r"^Gy(?=[XYZ](?![A-Za-z]))", "gyr"),
    (r"([XYZ])(Mps2|RadPerSec|MicroT)\b", r" \1 \2"),  # GnssLogger: UncalAccelXMps2, UncalGyroZRadPerSec
    # The size of a tick behind a name: ticks_25 us, ticks_1/32768 s; a unit behind "in" or "/".
    (r"(?i)(?:\s+in\s+|[\s_/]+)((?:1/)?\d[\d.]*\s*(?:k?hz|[mnuµ]?s))$", r" [\1]"),
    (r"\s+(?:in|/)\s+([^\s\])]+)$", r" [\1]"),
    # An index, also before a unit: gyro[0] [rad/s].
    (r"[\[({]\s*([012xyzXYZ])\s*[\])}]\s*([\[({][^\])}]*[\])}]\s*)?$", r" \1 \2"),
)
_LOOKS_LIKE_A_UNIT = re.compile(r"[/^²°]|\bper\b|^(ft|hz|rev|gon|grad|ips|rps|kdps|ug|µg)$|^(micro|nano|kilo|mega)")
"""Text in a bracket that is a unit, known or not; for an unknown unit the user is asked."""
_UNIT_BEHIND = re.compile(r"[xyz][ _]([a-zµ°]+/[a-z]+[0-9²]?)$")
"""A unit after the axis: gyro_x_rev/s."""
_OTHER_TIMES = frozenset({"min", "minute", "h", "hr", "hour"})
"""Words after which a unit is not one per second: rad/min begins as rad does."""
_OF_READINGS = frozenset(
    {"unit", "units", "raw", "data", "reading", "readings", "value", "values", "uncal", "uncalibrated", "total"}
    | {"type", "imu", "sensor", "android", "rate", "velocity", "axis", "non", "wakeup"}
)
"""Words beside the name of a sensor that change nothing in what it measures."""
_PART = re.compile(r"[a-z]\d[a-z]|\d\d|^3$")
"""In the name of a part, by which Android names sensors: LSM6DSO Accelerometer, 3-axis Gyroscope; not in imu2."""
_COUNTS = frozenset({"lsb", "digit", "digits", "count", "counts"})
"""Words for counts; mg/LSB is the LSB, not a unit of the readings."""
_RATES = {"p": "x", "q": "y", "r": "z"}
"""Names of angular rates in aeronautics, and their axes."""
_TURNS = {"roll": "x", "pitch": "y", "yaw": "z"}
_SPEEDS = frozenset({"rate", "velocity", "vel", "speed", "gyro", "gyr", "gyroscope"})
"""Words by which a column of roll, pitch or yaw is a rate, not an angle."""
_SAYS_SENSOR = frozenset({"deg/s", "mdeg/s", "rad/s", "mrad/s", "m/s^2"})
_SAYS_ANGLE = frozenset({"deg", "rad", "°"})
"""Units that state the sensor of a column with an unknown name, and what is spelled so without a rate."""
# The last two are the clock of GNSS receivers.
_TIME_WORDS = {"t", "time", "epoc", "chiptime", "timestamp", "timestamps", "ts", "stamp", "elapsed", "epoch", "clock"}
_TIME_WORDS |= {"when", "datetime", "uptime", "tow", "itow"}
_TICK_WORDS = {"ticks", "tick", "clk", "sensortime"}
"""Words for a counter of ticks whose frequency is not stated."""
_TIME_WORDS |= _TICK_WORDS | {"millis", "micros", "seconds", "secs", "unix"}
_STEP_WORDS = {"dt", "deltat", "deltatime", "timedelta"}
"""Words for the time since the previous row."""
_RATE_WORDS = {"rate", "frequency", "freq", "odr", "fs"}
_OF_RATES = {"sampling", "sample", "sensor", "output", "data", "update", "log", "logging", "imu", "nominal", "hz"}
_OF_RATES |= {"measurement"}
"""Words that may accompany the word for a rate; others mean another rate, such as a baud rate or an i2c frequency."""
_OF_CLOCKS = {"1", "unit", "units", "resolution", "size", "period", "frequency"}
_COUNTER_WORDS = {"index", "counter", "seq", "packet", "frame", "idx", "no", "number", "row", "samplenumber", "nr"}
_TEMPERATURE = re.compile(r"temp\w{0,4}|temperature\w*")
_SUPPLY = {"supply", "vdd", "vcc", "voltage", "vbat", "battery", "vin", "avdd"}

_UNITS = {
    "time": {
        "s": "s sec secs second seconds stime",
        "ms": "ms msec msecs millis milliseconds millisecond mstime cts",
        "us": "us µs usec micros microseconds microsecond ustime utime",
        "ns": "ns nsec nanos nanoseconds nanosecond nanosec nstime",
    },
    "accelerometer": {
        "m/s^2": "si ms2 mss mps2 mpss",
        "g": "g g0 gn gs gee gees",
        "mg": "mg millig mgee",
        "cm/s^2": "cms2 gal",
        "counts": "adc counts count lsb ticks digits int16 v mv volt volts",
        "raw": "raw",
    },
    "gyroscope": {
        "mdeg/s": "mdps mdegs mdegps",
        "rad/s": "si rads rad radps",
        "mrad/s": "mrads mrad mradps",
        "deg/s": "dps degs deg degps °s °",
        "deg/h": "dph degh degph °h",
        "rpm": "rpm revmin rmin",
        "counts": "adc counts count lsb ticks digits int16 v mv volt volts",
        "raw": "raw",
    },
}
_UNIT_OF = {
    sensor: {word: unit for unit, words in table.items() for word in words.split()} for sensor, table in _UNITS.items()
}
_TIME_UNIT_OF = _UNIT_OF.pop("time")
_SHORT = tuple(
    (re.compile(word), symbol)
    for word, symbol in (
        ("squared", "2"), ("radians?", "rad"), ("degrees?", "deg"), ("met(er|re)s?", "m"), ("milli", "m"),
        ("sec(ond)?s?(?=2?$)", "s"), ("h(ou)?rs?$", "h"), ("per(?=s|h)", ""),
    )
)  # fmt: skip
"""Words of units, and their symbols."""
_RANKS = (
    ({"measured", "raw", "uncalibrated", "uncalib", "uncal", "unbiased"}, 2),
    ({"unfilt", "unfiltered"}, 1),
    ({"rotation", "rot"}, -1),
    ({"user", "free", "linear", "linacc", "filtered", "lp", "smooth", "output"}, -2),
)
"""Words by which one of several triads is preferred: uncorrected readings, those with gravity, and rates (a rotation
may be a vector of angles)."""


@dataclass(frozen=True)
class ColumnName:
    """The meaning of a column name: ``unit`` as stated, known or not; ``role`` is accelerometer, gyroscope,
    translation, bare, time, step, temperature, supply, counter, or empty."""

    role: str = ""
    axis: str = ""
    group: str = ""
    unit: str = ""
    time_unit: str = ""
    rank: int = 0
    words: tuple[str, ...] = ()

    def unit_for(self, sensor: str) -> str:
        """The unit in the name, if the column is that sensor's."""
        return _unit(sensor, list(self.words))


def _unit(sensor: str, words: list[str]) -> str:
    """The unit that the remaining words of a name spell, joined or one by one."""
    table = _UNIT_OF[sensor]
    if not _COUNTS.isdisjoint(words):
        return "counts"
    found = [""]
    for length in (4, 3, 2, 1):
        for start in range(len(words) - length + 1):
            joined = _symbol(words[start : start + length])
            if joined in table and not set(words[start + length : start + length + 1]) & _OTHER_TIMES:
                found.append(table[joined])
    # gyroADC [dps]: where a name contains "ADC" and another unit, the latter is the unit.
    return next((unit for unit in found[1:] if unit not in ("counts", "raw")), found[min(len(found) - 1, 1)])


def _symbol(words: list[str]) -> str:
    """The symbol of a unit in words, without signs between them: ``radians per second`` is ``rads``."""
    text = "".join(words)
    for word, by in _SHORT:
        text = word.sub(by, text)
    return text


def _of_unit(text: str) -> list[str]:
    """Words of a unit, with exponents as digits: ``rad.s^-1`` is rad, s; ``m s^-2`` is m, s2."""
    for mark, digits in (("²", "2"), ("^", ""), ("-1", ""), ("-2", "2")):
        text = text.replace(mark, digits)
    return english(_WORD.findall(text))


def sensor_said(text: str) -> str:
    """The sensor that a remark, a record or a file is named after, with no other property of it; "" for others."""
    words = english(_WORD.findall(_CAMEL.sub(r"\1 \2", plain(text)).lower()))
    sensor = "" if len(words) > 1 and is_rate(text) else _sensor(words)
    known = _SENSOR_WORDS.get(sensor)
    is_known = known is not None and all(known.fullmatch(w) or w in _OF_READINGS or _PART.search(w) for w in words)
    return sensor if is_known else ""


def unit_said(sensor: str, text: str) -> str:
    """The unit, known or not, that a remark consists of; "" where it contains anything else."""
    is_unit = _LOOKS_LIKE_A_UNIT.search(text) and not text[:1].isdecimal()
    return known_unit(sensor, text) or (text if is_unit else "")


def known_unit(sensor: str, text: str) -> str:
    """The sensor's unit that a text spells, as named in the records; ``raw`` for raw readings; "" where unknown."""
    return _UNIT_OF[sensor].get(_symbol(_of_unit(plain(text).strip().lower())), "")


def clock_said(what: str, unit: str) -> str:
    """The time unit or tick size that a remark states: ``time in ms``, ``1 tick = 25 us``; else ""."""
    words = english(_WORD.findall(plain(what).lower()))
    sized = re.sub(r"^ticks?\s+of\s+", "", unit)
    is_tick = sized != unit or not _TICK_WORDS.isdisjoint(words)
    is_clock = not _TIME_WORDS.isdisjoint(words) and all(w in _TIME_WORDS or w in _OF_CLOCKS for w in words)
    known = _TIME_UNIT_OF.get(sized, sized if is_tick else "")
    return known if is_clock and seconds_of(known) > 0.0 else ""


def is_rate(text: str) -> bool:
    """Whether a remark's key names the sampling rate and nothing else: ``Sample rate``, ``ODR``, ``fs [Hz]``."""
    words = _WORD.findall(_CAMEL.sub(r"\1 \2", text).lower())
    return not _RATE_WORDS.isdisjoint(words) and all(w in _RATE_WORDS or w in _OF_RATES for w in words)


@lru_cache(maxsize=4096)
def parse_name(name: str) -> ColumnName:
    """The meaning of a column called ``name``."""
    text = plain(name.strip().strip('"').strip())
    for pattern, by in _SPELLINGS:
        text = re.sub(pattern, by, text)
    text = text.rstrip()
    found = re.search(r"[\[({]\s*([^\])}]*?)\s*[\])}]$", text)
    bracket, text = (found[1].lower(), text[: found.start()]) if found else ("", text)
    text = text.replace("m/s^2", "m_s2").replace("m/s²", "m_s2")
    # The LSB or a range is not a unit of the readings.
    stated = "" if re.match(r"[±+x*×-]*\s*\d[\d.]*(\s*/\s*[\d.]+)?\s*[a-zµ°]", bracket) else bracket
    said = _classify(english(_WORD.findall(_CAMEL.sub(r"\1 \2", text).lower())), _of_unit(stated))
    behind = _UNIT_BEHIND.search(text.lower())
    unknown = stated if _LOOKS_LIKE_A_UNIT.search(stated) else behind[1] if behind else ""
    if said.role in _SENSOR_WORDS and not said.unit and unknown:
        return replace(said, unit=unknown)
    if said.role in ("time", "step") and bracket and seconds_of(bracket) > 0.0:
        return replace(said, time_unit=bracket)
    return said


def _classify(words: list[str], unit_words: list[str]) -> ColumnName:
    if not words:
        return ColumnName()
    single = _single_role(words, unit_words)
    if single is not None:
        return single
    about = _about_axis(words, unit_words)
    if about is not None:
        return about
    text = " ".join(words)
    apart = (found for pattern, by in _GLUED if (found := pattern.sub(by, text, count=1)) != text)
    rest = [word for word in next(apart, text).split() if word != "axis" or len(words) == 1]
    axes = [at for labels in ("xyz", "0123") for at, word in enumerate(rest) if word in labels]
    at = max((at for at in axes if rest[at] in "xyz"), default=max(axes, default=None))
    axis = "" if at is None else rest.pop(at)
    if not axis or any(word in _NOT_A_SENSOR for word in rest):
        return ColumnName()
    sensor = _sensor(rest)
    left = [w for w in rest if not any(p.fullmatch(w) for p in _SENSOR_WORDS.values())]
    if sensor and left and len(rest) == len(left) and _LETTER.get(left[0]) == sensor:
        left = left[1:]
    key = " ".join(rest) + "|" + " ".join(unit_words)
    if not sensor:
        if not rest and "".join(unit_words) in _TIME_UNIT_OF:
            return ColumnName("time", time_unit=_TIME_UNIT_OF["".join(unit_words)])  # X[s]: Delsys' clock of a channel
        is_unit = bool(rest) and any("".join(rest) in table for table in _UNIT_OF.values())
        by_unit = [(one, unit) for one in _UNIT_OF if (unit := _unit(one, unit_words)) in _SAYS_SENSOR]
        if by_unit and rest and not is_unit and _symbol(unit_words) not in _SAYS_ANGLE:
            return ColumnName(by_unit[0][0], axis, key, by_unit[0][1], rank=-3)
        return ColumnName("bare" if is_unit or not rest else "", axis, key, words=tuple(rest + unit_words))
    unit = _unit(sensor, unit_words) or _unit(sensor, left) if sensor in _UNIT_OF else ""
    rank = sum(points for known, points in _RANKS if not known.isdisjoint(rest))
    return ColumnName(sensor, axis, key, unit, rank=rank)


def _about_axis(words: list[str], unit_words: list[str]) -> ColumnName | None:
    """The gyro axis of ``p``, ``q``, ``r``, or of a rate of roll, pitch or yaw; None for other names."""
    turns, rest = [word for word in words if word in _TURNS], words[1:]
    if words[0] not in _RATES:
        if len(turns) != 1 or _SPEEDS.isdisjoint(words):
            return None
        known = _SPEEDS | _OF_READINGS | {*turns}
        rest = [word for word in words if word not in known and not _DEVICE_WORD.match(word)]
    of_name = _unit("gyroscope", rest)
    if rest and not of_name:
        return None
    axis, group = (_TURNS[turns[0]], "roll pitch yaw") if turns else (_RATES[words[0]], "p q r")
    return ColumnName("gyroscope", axis, group, _unit("gyroscope", unit_words) or of_name, rank=-1)


def _sensor(words: list[str]) -> str:
    hits = {s for s, pattern in _SENSOR_WORDS.items() if any(pattern.fullmatch(w) for w in words)}
    if {"angular", "acceleration"} <= set(words) or {"rotation", "vector"} <= set(words):
        return ""
    if len(hits) == 1:
        return hits.pop()
    if words and words[0] == "alpha":
        return "translation"  # Kalibr's name for acceleration if omega is there too; else an angular acceleration
    while len(words) > 1 and _DEVICE_WORD.match(words[0]):
        words = words[1:]
    return _LETTER.get(words[0], "") if words else ""


def _single_role(words: list[str], unit_words: list[str]) -> ColumnName | None:
    joined = "".join(words)
    is_warmth = words == ["t"] and set(unit_words) & {"°", "c", "°c", "degc", "k"}
    if is_warmth or any(_TEMPERATURE.fullmatch(w) for w in words):
        return ColumnName("temperature", words=tuple(words))
    if any(w in _SUPPLY for w in words):
        if "mv" in unit_words:
            return ColumnName()  # supply_v is in volts
        return ColumnName("supply", words=tuple(words))
    if joined == "sampletimefine":
        return ColumnName("time", time_unit="100us", rank=3)
    if "".join(w for w in words if w not in _TIME_UNIT_OF) in _STEP_WORDS:
        units = [_TIME_UNIT_OF[w] for w in [*words, *unit_words] if w in _TIME_UNIT_OF]
        return ColumnName("step", time_unit=units[-1] if units else "")
    if words[0] == "utc" or "relative" in words:
        return ColumnName()
    if joined in {"nsamples", "sample", "samples", "samplecounter", "packetcounter", "n", "i"} or (
        words[-1] in _COUNTER_WORDS and len(words) <= 2
    ):
        return ColumnName("counter")
    is_time = (
        words[0] in _TIME_WORDS
        or (words[-1] == "t" and all(_DEVICE_WORD.match(word) for word in words[:-1]))
        or not {"time", "timestamp", "timestamps", "stamp", "datetime", "tow", "itow"}.isdisjoint(words)
        or all(w in _TIME_WORDS or w in _TIME_UNIT_OF for w in words)
    )
    if is_time and {"x", "y", "z", "zone", "valid"}.isdisjoint(words) and words[-1] != "offset":
        units = [_TIME_UNIT_OF[w] for w in [*words, *unit_words] if w in _TIME_UNIT_OF]
        rank = 2 if words[0] in {"t", "time", "timestamp"} else 1
        if not units and {*words, joined} & _TICK_WORDS:
            units, rank = ["tick"], rank - 1
        return ColumnName("time", time_unit=units[-1] if units else "", rank=rank + bool(units and units[-1] != "tick"))
    return None
