"""Names of effects, parameters, domains and axes in print."""

import re
from collections.abc import Iterable

from trihedron.report.numbers import listed

LETTERS = 2
"""Most letters of a name that consists of axes alone, as ``xy``."""
QUANTITIES = {"w": "angular rate", "u": "specific force", "f": "specific force"}
"""Symbols of the variables of empirical relations."""
MEANING = {
    "accel-common-scale": "common scale of all accelerometer axes",
    "gyro-common-scale": "common scale of all gyro axes",
    "static-accel": "gravity error in static poses",
    "static-gyro": "gyro rate in static poses",
    "moves": "tilt error after a rotation",
    "dynamics": "velocity error over a rotation",
    "rate": "angular rate beside the reference",
    "within-static": "noise within static poses",
    "timing": "time error of samples, seen in motion",
    "parameters": "parameters of the model",
    "noise": "noise and sampling",
}
"""Parameters and domains of residuals in words."""
FINDINGS = {
    "accelerometer-nominal": "accelerometer not calibrated",
    "calibration-doubted": "warnings of single recordings",
    "calibration-imprecise": "errors larger than by the log's own calibration",
    "calibration-shift": "parameters differ",
    "effect-not-applied": "effect not compensated",
    "effects-modelled": "residuals that no effect explains",
    "filter-noise-below-quietest": "N below the noise of the quietest second",
    "filter-noise-followed": "reference follows the sensor's noise",
    "filter-noise-inconsistent": "NEES inconsistent",
    "filter-noise-other-static": "static log unlike this log",
    "filter-noise-static": "no reference",
    "filter-noise-uncalibrated": "errors that a calibration removes",
    "filter-noise-uncertain": "N uncertain",
    "filter-noise-unsettled": "search not settled",
    "gravity-defaulted": "gravity not given",
    "held-out-worse": "tilt error after rotations above noise",
    "log-drift": "warm-up or slow change of the bias",
    "log-jump": "jumps of the level",
    "log-motion": "motion or vibration in the log",
    "non-finite": "rows without time",
    "not-tested": "parameters that this log does not test",
    "reference-misfit": "parts of the log disagree",
    "reference-of-itself": "reference in the log's own file",
    "static-rate-above-noise": "gyro rate in static poses above noise",
    "log-uneven": "noise of changing level",
    "spectrum-low-pass": "low-pass in the spectrum",
    "spectrum-unexplained": "spectrum unlike the fitted terms",
    "table-tilt": "faces that contradict each other",
    "two-levels": "level that switches",
    "turntable": "turntable speeds that moves and poses contradict",
    "time-duplicate": "equal timestamps",
    "time-unit-detected": "time unit uncertain",
    "turn-not-a-multiple": "turn excluded",
    "turn-unchecked": "axis with a single turn",
}
"""Warnings in words, where the code is no phrase of the field."""


def axis_in_print(name: str) -> str:
    """Axes as on the silkscreen: ``xy`` and ``gyro x`` as ``XY`` and ``gyro X``."""
    sensor, gap, axis = name.rpartition(" ")
    return f"{sensor}{gap}{axis.upper()}" if len(axis) <= LETTERS else name


def id_in_print(name: str) -> str:
    """An effect, a domain or a parameter in words: ``accel-bias`` as ``accelerometer bias``, ``gyro-g-sensitivity`` as
    ``gyro g-sensitivity``, ``gyro-bias-x`` as ``gyro bias X``."""
    spaced = re.sub(r"(?<!-g)-(?!gyro)", " ", re.sub(r"^accel\b", "accelerometer", name))
    return MEANING.get(name) or axis_in_print(spaced)


def finding_in_print(code: str) -> str:
    return FINDINGS.get(code) or id_in_print(code)


def label_of(group: str, name: str) -> str:
    """A parameter as the label of a row or an axis, by the name that it has in sentences: ``accelerometer bias X``."""
    return f"{id_in_print(group)} {parameter_in_print(name)}"


def ids_in_print(names: Iterable[str]) -> str:
    """Several of them as ``a, b and c``."""
    return listed([id_in_print(name) for name in names])


def parameter_in_print(name: str) -> str:
    """A parameter of an effect: symbols as they are, with ``σ`` for ``sigma``; ``range_x`` as ``range X``."""
    stem, _, axis = name.replace("sigma_", "σ_").rpartition("_")
    if not re.fullmatch(r"[xyz]+[+-]?", axis):
        return name.replace("_", " ")
    return f"{stem}_{axis}" if 0 < len(stem) <= LETTERS else f"{stem.replace('_', ' ')} {axis.upper()}".lstrip()


def variable_in_print(name: str) -> str:
    """A variable of an empirical relation in words: ``w_x f_y`` as ``angular rate X × specific force Y``."""
    said = re.sub(r"(?<=_[xyz]) (?=[wuf]_)", " × ", name)
    said = re.sub(r"\b([wuf])(?:_([xyz]))?\b", lambda f: f"{QUANTITIES[f[1]]} {(f[2] or '').upper()}".strip(), said)
    said = re.sub(r"(?<=about )[xyz]\b|^[xyz](?=:)", lambda found: found[0].upper(), said)
    return said.replace("^2", "²").replace("^3", "³")


def channel_in_print(channel: str) -> str:
    """``gx`` and ``vx`` as ``X``; names other than axes (``norm``, ``angle``) unchanged."""
    return channel[-1].upper() if len(channel) <= LETTERS else channel


def term_in_print(term: str) -> str:
    """A term of compared noise and sampling: figures of the poses are distinct from those of the whole log."""
    return {"bandwidth": "-3 dB bandwidth in the poses", "jitter": "timestamp scatter"}.get(term, term)
