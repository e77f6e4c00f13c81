"""Report of a ranking of calibrations."""

import math

from trihedron.records import Severity
from trihedron.records.ranking import Ranked, Ranking, Suspicion
from trihedron.report.document import Document, Facts, Section, Table
from trihedron.report.findings import by_weight, findings_block
from trihedron.report.numbers import how_many, listed, plain_number, with_sigma
from trihedron.report.verification import above_noise, imprecise, parameters_table, use_in_words, verified_in_words
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians, mm_s2_from_m_s2

MISTAKES = {
    "bias-sign": "the bias has the wrong sign",
    "bias-order": "the bias belongs to the other side of the matrix",
    "bias-unit": "the bias is in the wrong unit",
    "direction": "the matrix maps the other way (true to raw for raw to true)",
    "transpose": "the matrix is transposed",
    "unit": "the unit is wrong",
    "axes": "axes are exchanged or mirrored (another frame)",
    "gravity": "it was made with another gravity",
}


def ranking_report(ranking: Ranking) -> Document:
    """Lay out a ranking: the order, likely mistakes of each, and the parameters of the best."""
    best = ranking.best
    rejected = [one.name for one in ranking.candidates if one.is_rejected]
    v = best.verification
    alike = [one.name for one in ranking.candidates if not (one.is_rejected or one.is_clearly_behind)]
    verdict = f"{best.name} fits this log best"
    if len(alike) > 1:
        verdict = f"{listed(alike)} fit this log equally well (within 2 σ); {best.name} is first"
    verdict += f"; {listed(rejected)} {'is' if len(rejected) == 1 else 'are'} rejected" if rejected else ""
    verdict += f". {verified_in_words(v)}"
    if best.is_rejected:
        verdict = f"None of these calibrations fits this log: of the best, {best.name}, {said_of(best)}."
    judged_on = f"{how_many(len(v.norm_error), 'pose')}, {how_many(len(v.angle_deg), 'move')}"
    facts = (("gravity", f"{ranking.gravity_m_s2:.5f} m/s², {ranking.gravity_source}"), ("judged on", judged_on))
    sections = [
        Section("Ranking", (Facts(facts), _order(ranking))),
        Section("What is wrong with each", (Facts(tuple((one.name, said_of(one)) for one in ranking.candidates)),)),
        Section("Findings about the best", (findings_block(v.findings),)),
        Section("Parameters of the best", (parameters_table(v),)),
    ]
    return Document(
        title="Ranking of calibrations",
        subtitle=ranking.source,
        verdict=verdict,
        stated_level="bad" if best.is_rejected else None,
        sections=tuple(sections),
        next_step="Calibrate again: none of these fits this log." if best.is_rejected else use_in_words(v, best.name),
    )


def said_of(one: Ranked) -> str:
    """Likely mistakes or the gravest findings of a calibration, with figures, and sensors whose bias its file lacks."""
    said = [_mistake(found) for found in one.suspicions]
    if not said:
        said = [f.seen.rstrip(".") for f in by_weight(one.verification.findings) if f.severity is not Severity.NOTE][:2]
    said = said or [f"nothing found{', but another fits better' if one.is_clearly_behind else ''}"]
    if one.without_bias:
        said.append(f"its file has no bias of the {' and the '.join(one.without_bias)}: that of this log was taken")
    return "; ".join(said)


def _mistake(found: Suspicion) -> str:
    words = MISTAKES[found.kind]
    if found.kind == "gravity":
        words += f" ({found.factor:.5f} times that of this place)"
    elif found.kind == "unit":
        words += f" (by a factor of {_factor(found.factor)})"
    return f"{words}; corrected, its error falls to {plain_number(100.0 * found.rms_undone / found.rms, 2)} % of this"


def _factor(factor: float) -> str:
    for value, words in ((STANDARD_GRAVITY_M_S2, "9.80665, g for m/s²"), (degrees_from_radians(1.0), "57.3, degrees")):
        if math.isclose(factor, value) or math.isclose(factor, 1.0 / value):
            return words
    return f"{factor:.4g}"


def _order(ranking: Ranking) -> Table:
    head = (
        "file", "judged", "gravity error [mm/s²]", "tilt error [°]", "behind the best", "static rate [°/s]", "made by",
    )  # fmt: skip
    rows = tuple(
        (
            f"{k + 1}. {one.name}",
            _judged(one),
            _with_interval(one.verification.norm_rms, one.norm_interval, mm_s2_from_m_s2(1.0)),
            _with_interval(one.verification.angle_rms_deg, one.angle_interval, 1.0),
            with_sigma(one.behind, one.behind_sigma) if one.behind_sigma > 0.0 else plain_number(one.behind, 3),
            plain_number(degrees_from_radians(one.static_rate_rms), 2),
            one.maker,
        )
        for k, one in enumerate(ranking.candidates)
    )
    caption = "Best first. Errors: RMS with their 95 % interval. Behind the best: logarithm of how many times less "
    caption += "probable the log is by this calibration, ± 1 σ; beyond 2 σ the best is clearly better"
    return Table(head, rows, caption)


def _judged(one: Ranked) -> str:
    if one.is_rejected or above_noise(one.verification):
        return "rejected" if one.is_rejected else "doubtful"
    return "imprecise" if imprecise(one.verification.findings) else "verified"


def _with_interval(rms: float, interval: tuple[float, float], factor: float) -> str:
    if not math.isfinite(rms):
        return ""
    low, high = (plain_number(factor * end, 3) for end in interval)
    return f"{plain_number(factor * rms, 3)} ({low} to {high})"


def ranking_record(ranking: Ranking) -> dict[str, object]:
    """The ranking as plain JSON types, SI and degrees."""
    return {
        "recording": ranking.source,
        "gravity_m_s2": ranking.gravity_m_s2,
        "gravity_source": ranking.gravity_source,
        "candidates": [
            {
                "name": one.name,
                "maker": one.maker,
                "is_rejected": one.is_rejected,
                "log_density_behind_best": one.behind,
                "log_density_sigma": one.behind_sigma,
                "gravity_error_rms_m_s2": one.verification.norm_rms,
                "gravity_error_interval_m_s2": list(one.norm_interval),
                "tilt_error_rms_deg": one.verification.angle_rms_deg,
                "tilt_error_interval_deg": list(one.angle_interval),
                "static_rate_rms_rad_s": one.static_rate_rms,
                "mistakes": [vars(found) for found in one.suspicions],
                "without_bias": list(one.without_bias),
                "findings": [finding.to_dict() for finding in one.verification.findings],
            }
            for one in ranking.candidates
        ],
    }
