"""Names and units of noise terms: SI, and those of IEEE 952 that data sheets use."""

from trihedron.records import TermName
from trihedron.report.numbers import unit_in_print
from trihedron.units import arcsec_from_radians, degrees_from_radians, micro_g_from_m_s2, per_hour, per_root_hour

TERM_WORDS = {
    TermName.QUANTISATION: "quantisation",
    TermName.WHITE: "white",
    TermName.BIAS_INSTABILITY: "bias instability",
    TermName.RATE_RANDOM_WALK: "random walk",
    TermName.RATE_RAMP: "ramp",
}
IN_SLOW_NOISE = {
    "temperature-driven": "the temperature",
    "log-turned": "a turn of the unit",
    "two-levels": "a level that switches",
}
"""What B, K and R contain where a finding says so."""
QUANTITIES = {"rad/s": "rate", "deg/s": "rate", "m/s^2": "acceleration", "g": "acceleration"}
"""What a reading is, in the names of K and R."""
PER_UNIT = {
    TermName.QUANTISATION: "·s",
    TermName.WHITE: "/√Hz",
    TermName.BIAS_INSTABILITY: "",
    TermName.RATE_RANDOM_WALK: "/√s",
    TermName.RATE_RAMP: "/s",
}


def term_in_words(term: TermName, unit: str) -> str:
    """Name of a noise term for readings in ``unit``: the random walk of a gyro is a rate random walk."""
    quantity = QUANTITIES.get(unit, "") if term in (TermName.RATE_RANDOM_WALK, TermName.RATE_RAMP) else ""
    return f"{quantity} {TERM_WORDS[term]}".lstrip()


def unit_of(term: TermName, unit: str) -> str:
    """Printed unit of a noise term for readings in ``unit``."""
    printed = unit_in_print(unit)
    if unit == "m/s^2" and term in (TermName.RATE_RAMP, TermName.QUANTISATION):
        return "m/s³" if term is TermName.RATE_RAMP else "m/s"
    if unit == "rad/s" and term in (TermName.RATE_RAMP, TermName.QUANTISATION):
        return "rad/s²" if term is TermName.RATE_RAMP else "rad"
    return printed + PER_UNIT[term]


def customary(term: TermName, unit: str) -> tuple[str, str, float] | None:
    """IEEE 952 name, customary unit and factor from SI of a term; None where the unit of the log is unknown."""
    if unit == "rad/s":
        deg = degrees_from_radians(1.0)
        return {
            TermName.QUANTISATION: ("quantisation noise", "arcsec", arcsec_from_radians(1.0)),
            TermName.WHITE: ("angle random walk", "°/√h", per_root_hour(deg)),
            TermName.BIAS_INSTABILITY: ("bias instability", "°/h", per_hour(deg)),
            TermName.RATE_RANDOM_WALK: ("rate random walk", "°/h/√h", per_hour(per_root_hour(deg))),
            TermName.RATE_RAMP: ("rate ramp", "°/h/h", per_hour(per_hour(deg))),
        }[term]
    if unit == "m/s^2":
        return {
            TermName.QUANTISATION: ("quantisation noise", "m/s", 1.0),
            TermName.WHITE: ("velocity random walk", "m/s/√h", per_root_hour(1.0)),
            TermName.BIAS_INSTABILITY: ("bias instability", "µg", micro_g_from_m_s2(1.0)),
            TermName.RATE_RANDOM_WALK: ("acceleration random walk", "µg/√h", per_root_hour(micro_g_from_m_s2(1.0))),
            TermName.RATE_RAMP: ("acceleration ramp", "µg/h", per_hour(micro_g_from_m_s2(1.0))),
        }[term]
    return None
