"""Sentences that effects of both sensors share."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from trihedron.report.effects.entry import EffectWords

LOG_TEMPERATURE = "log the temperature, or let the sensor warm up and repeat the first poses at the end"
UP_AND_DOWN = "repeat one pose while the temperature both rises and falls: drift in time does not reverse"
TWO_TEMPERATURES = "repeat the same faces and turns at two temperatures"
COME_BACK = (
    "turn away from one pose and back to it ten times: what differs is repeatability, what returns depends on the pose"
)
BOTH_SIDES_OF_LEVEL = (
    "add tilts of 30°, 45° and 60° on both sides of level: a square and a modulus differ between the faces"
)
SHAKE = "shake the sensor about one axis at several frequencies: a delay grows with frequency, a low-pass saturates"


def drifts(sensor: str, unit: str, walk: str, at_rest: str = "") -> Mapping[str, str]:
    """Bias drift from pose to pose, by its kind; in a log of one orientation ``at_rest`` is added."""
    whole = f"The {sensor} bias drifts {{how}} by {{sizes}} (X, Y, Z); no logged channel explains it."
    sizes = f"{{range:all .2g {unit}}}"
    rest = {case: whole.format(how="smoothly", sizes=_at_rest("range", own)) + at_rest for case, own in _units(unit)}
    return MappingProxyType({"walk": whole.format(how=walk, sizes=sizes)} | rest)


def follows_temperature(sensor: str, unit: str) -> Mapping[str, str]:
    """Bias over temperature in a log of one or two orientations, and effects that it is confounded with."""
    return MappingProxyType({case: _thermal(sensor, own) for case, own in _units(unit)})


def _units(unit: str) -> tuple[tuple[str, str], ...]:
    """Cases of a static log, with their unit: readings of unknown scale stay counts."""
    return (("at-rest", unit), ("at-rest-counts", "counts"))


def _at_rest(place: str, unit: str) -> str:
    if unit == "counts":
        return f"{{{place}:all .3g}} counts"
    return f"{{{place}:all {'.2g' if unit == '°/s' else '.3g'} {unit}}}"


def _thermal(sensor: str, unit: str) -> str:
    swing, left, raw, gap = (_at_rest(place, unit) for place in ("swing", "left", "raw", "gap"))
    return (
        f"The {sensor} bias follows the temperature from {{low_degc:.0f}} to {{high_degc:.0f}} °C by "
        "{is_straight:?a straight line|{is_parabola:?a parabola|a curve of third order}}"
        "{has_rate:?, and its rate of change|}{has_branches:?, on two branches|}: it changes by "
        f"{swing} (X, Y, Z); {left} rms remain of {raw}."
        f"{{has_gap:? At one temperature heating and cooling differ by {gap}: hysteresis or drift in time; "
        "one cycle does not separate them.|}{is_one_pose:? One orientation does not separate bias, scale and a tilt of "
        "the fixture.|}"
    )


def saturates(effect_id: str, sensor: str) -> EffectWords:
    """Words of the effect of a range limit."""
    end = f"the {sensor} reaches its range limit"
    return EffectWords(
        effect_id,
        end,
        "repeat the moves more slowly, or choose a wider range",
        MappingProxyType(
            {
                "plateaus": f"T{end[1:]}: {{plateaus}} plateaus, {{samples}} samples, in {{touched}} of {{moves}} "
                "moves; clipped readings are excluded from the fit."
            }
        ),
    )
