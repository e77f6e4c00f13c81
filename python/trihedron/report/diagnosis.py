"""A diagnosis as a report: what disagrees, which effects are missing, how the fit improves, what is unexplained."""

import re
from collections.abc import Iterable
from functools import partial

from trihedron.records import Finding
from trihedron.records.diagnosis import AcceptedEffect, Diagnosis
from trihedron.records.domains import DOMAINS, DomainResiduals, DomainTest, HeldOut
from trihedron.report.calibration_fit import figures_table
from trihedron.report.diagnosis_charts import (
    before_after_chart,
    effect_chart,
    forest_picture,
    noise_pictures,
    traces_picture,
)
from trihedron.report.diagnosis_models import candidates_blocks, models_blocks, relation_facts
from trihedron.report.diagnosis_next_step import next_step_in_words
from trihedron.report.diagnosis_numbers import (
    differing_blocks,
    differing_noise,
    noise_blocks,
    numbers_blocks,
    stages_blocks,
)
from trihedron.report.diagnosis_words import (
    NOT_JUDGED,
    findings_of,
    follows,
    is_explained,
    judged_in_words,
    level_of,
    p_in_words,
    parameter_unit,
    quantity,
    rms_in_words,
    size_in_words,
    value_in_words,
    where_in_words,
    whole_verdict,
)
from trihedron.report.document import Block, Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.findings import findings_block
from trihedron.report.names import MEANING, id_in_print, ids_in_print, parameter_in_print
from trihedron.report.numbers import capital, how_many, plain_number
from trihedron.report.reference import beside_model, beside_reference, hidden_by
from trihedron.report.segments import pose_lines

_CAPTIONS = {
    "static-accel": "Gravity error in every static pose.",
    "static-gyro": "Mean gyro rate in every static pose, about its mean.",
    "moves": "Tilt error after every rotation: gravity predicted with the gyro against gravity measured.",
    "dynamics": "Velocity error over a rotation: integral of acceleration between two poses; should be 0.",
}
LEAST_SHARE = 0.005
"""Smallest share of the misfit that is printed."""
MOST_PARAMETERS = 9


def first_screen(diagnosis: Diagnosis) -> int:
    """Number of sections on the first screen: disagreement, parameters that differ, missing effects, unexplained."""
    return 4 if diagnosis.parameters else 3


def diagnosis_report(diagnosis: Diagnosis, model: str = "", improved: str = "") -> Document:
    """Lay out a diagnosis; the first sections fit one screen. ``model`` names the file compared with the log,
    ``improved`` the scenario written with the parameters of the log."""
    sections = [Section("Result", _located(diagnosis))]
    differing = [one for one in diagnosis.parameters if one.significant]
    if diagnosis.parameters:
        about = (forest_picture(diagnosis.parameters), *differing_blocks(diagnosis), *_traces(diagnosis))
        is_apart = differing or differing_noise(diagnosis)
        sections.append(Section("Parameters that differ" if is_apart else "Parameters of the model", about))
    sections += [
        Section("Missing effects", (*effects_blocks(diagnosis), *effect_pictures(diagnosis))),
        Section("Unexplained", (Paragraph(_remaining(diagnosis)), *map(relation_facts, diagnosis.relations))),
        Section("Candidates", candidates_blocks(diagnosis)),
        Section("Calibration and noise", _models(diagnosis)),
    ]
    if diagnosis.parameters:
        sections.append(Section("Stage by stage", stages_blocks(diagnosis)))
        sections += [Section("Parameters that agree", (table,)) for table in numbers_blocks(diagnosis)]
    if diagnosis.noise_compared:
        noise = (*noise_blocks(diagnosis), *noise_pictures(diagnosis))
        sections.append(Section("Noise and sampling of the model", noise))
    findings: Iterable[Finding] = findings_of(diagnosis)
    if diagnosis.verdict in ("not-testable", "unexplained"):
        # No result to be used, of which the size of gravity would decide.
        findings = [one for one in findings if one.code != "gravity-defaulted"]
    found = getattr(diagnosis, "reference", None)
    is_model = found is not None and found.source == model
    if is_model:
        # The motion of a simulated log is that of this one.
        findings = [one for one in findings if one.code != "reference-apart"]
    if findings:
        sections.append(Section("Findings", (findings_block(findings),)))
    if diagnosis.residuals:
        sections.append(Section("Figures", tuple(_picture(diagnosis, one) for one in diagnosis.residuals)))
    # By a reference alone a model without a gyro, or a simulation, is not compared.
    is_compared = model != "" and (diagnosis.parameters != () or not by_reference_alone(diagnosis))
    document = Document(
        title="Diagnosis against a model" if diagnosis.parameters else "Diagnosis",
        subtitle=f"{diagnosis.recording_source} against {model}" if is_compared else diagnosis.recording_source,
        verdict=whole_verdict(diagnosis) + (hidden_by(found) if diagnosis.verdict == "consistent" else ""),
        sections=tuple(sections),
        lead=forest_picture(diagnosis.parameters) if differing else worst_picture(diagnosis),
        next_step=next_step_in_words(diagnosis, model, improved),
        stated_level=level_of(diagnosis),
    )
    return beside_model(document, found) if found is not None and is_model else beside_reference(document, found)


def worst_picture(diagnosis: Diagnosis) -> Picture | None:
    """The residual of the domain with the largest χ², without and with the effects."""
    chi2 = {one.domain: one.chi2_per_dof for one in diagnosis.domains}
    worst = max(diagnosis.residuals, key=lambda one: chi2.get(one.domain, 0.0), default=None)
    return None if worst is None else _picture(diagnosis, worst)


def _models(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """S, b and noise; by a reference alone S and b are in its own section."""
    blocks = models_blocks(diagnosis)
    return tuple(b for b in blocks if not isinstance(b, Table)) if by_reference_alone(diagnosis) else blocks


def by_reference_alone(diagnosis: Diagnosis) -> bool:
    """Whether the log had too few poses for a diagnosis of its own."""
    return all(one.domain == "rate" for one in diagnosis.domains) and getattr(diagnosis, "reference", None) is not None


def _located(diagnosis: Diagnosis) -> tuple[Block, ...]:
    if not diagnosis.domains:
        return (Paragraph("No domain was tested."),)
    after = {d.domain: d for d in diagnosis.remaining}
    # Most important columns first: on a narrow terminal the others move below.
    head: tuple[str, ...] = ("residual", "linear model", "rms", "χ²/dof", "p")
    rows: list[tuple[str, ...]] = [
        (
            MEANING[d.domain], judged, rms_in_words(d), plain_number(d.chi2_per_dof),
            "–" if judged == NOT_JUDGED else p_in_words(d.p_value),
        )
        for d in diagnosis.domains
        for judged in (judged_in_words(diagnosis, d),)
    ]  # fmt: skip
    if diagnosis.effects:
        head = (*head[:2], "with the effects", *head[2:], "rms with them", "χ²/dof with them")
        with_them = [_after(diagnosis, d, after.get(d.domain)) for d in diagnosis.domains]
        rows = [(*row[:2], now[0], *row[2:], *now[1:]) for row, now in zip(rows, with_them, strict=True)]
    is_fitted = not getattr(diagnosis, "model_is_given", False)
    # Where the log determines S and b, a given model is compared with these in a row of its own.
    is_refitted = not is_fitted and getattr(diagnosis, "updated", None) is not None
    beside = ", in sample" if is_fitted else ", S and b fitted to this log (model: last row)" if is_refitted else ""
    caption = f"Residuals by domain{beside}; χ²/dof is 1 by noise alone"
    caption += f", and a residual disagrees below p {plain_number(diagnosis.alpha / len(DOMAINS), 2)}"
    blocks: list[Block] = [Table(head, tuple(rows), caption)]
    # Parameters that differ have a section of their own.
    places = tuple(
        (MEANING[d.domain], place)
        for d in diagnosis.domains
        if d.disagrees and d.domain != "parameters" and (place := where_in_words(d))
    )
    if places:
        blocks.append(Facts(places))
    own = getattr(diagnosis, "calibration", None)
    if own is not None and is_fitted:
        table = figures_table(own, {MEANING[d.domain]: rms_in_words(d) for d in diagnosis.domains})
        blocks += [table] if table is not None else []
    return tuple(blocks)


def _after(diagnosis: Diagnosis, before: DomainTest, test: DomainTest | None) -> tuple[str, str, str]:
    """Judgement, rms and χ²/dof of a domain with the effects."""
    if test is None:
        return "–", "–", "–"
    judged = "explained" if is_explained(before, test) else "disagrees" if test.disagrees else "agrees"
    judged = follows(diagnosis, test) or judged
    return judged, rms_in_words(test), plain_number(test.chi2_per_dof)


def effects_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    if not diagnosis.effects:
        said = "No effect of the catalogue is accepted." if diagnosis.domains else "None was tested."
        return (Paragraph(said),)
    blocks: list[Block] = []
    for k, effect in enumerate(diagnosis.effects):
        rows = [
            (f"{k + 1}. {id_in_print(effect.id)}", _without_strongest(effect.statement)),
            ("", _parameters(effect)),
            ("", _evidence(effect)),
        ]
        if effect.confounded_with:
            rivals = ids_in_print(effect.confounded_with)
            separating = effect.separating_experiment or "record other poses and moves"
            rows.append(("", f"Confounded with {rivals} in this recording. To separate them: {separating}."))
        blocks.append(Facts(tuple(row for row in rows if row[1])))
    return tuple(blocks)


def _without_strongest(statement: str) -> str:
    """The sentence without its strongest term, which is listed below it with its uncertainty."""
    return capital(re.sub(r"\s*\(strongest term [^:]*: [^;]*?\)(?=\.|$|;)", "", statement))


def _parameters(effect: AcceptedEffect) -> str:
    """Parameters of one unit share a power of ten: ``K2_x 297 ± 16, K2_y −178 ± 15 (10⁻⁶ s²/m)``."""
    units = list(dict.fromkeys(p.unit for p in effect.parameters))
    groups = []
    for unit in units:
        members = [p for p in effect.parameters if p.unit == unit]
        scale, shared = parameter_unit(unit, max(abs(p.value) for p in members))
        words = [
            f"{parameter_in_print(p.name)} {value_in_words(scale * p.value, scale * p.std)}"
            for p in members[:MOST_PARAMETERS]
        ]
        words += [f"{len(members) - MOST_PARAMETERS} more"] if len(members) > MOST_PARAMETERS else []
        groups.append(", ".join(words) + (f" [{shared}]" if shared else ""))
    return "; ".join(groups)


def _evidence(effect: AcceptedEffect) -> str:
    words = f"p {p_in_words(effect.p_adjusted)} corrected for multiple testing, ΔBIC {plain_number(effect.delta_bic)}"
    if effect.share is not None and effect.share > LEAST_SHARE:
        words += f"; by itself it explains {plain_number(100.0 * effect.share, 2)} % of the misfit"
    if effect.held_out:
        first, *others = effect.held_out
        chi2 = f"{plain_number(first.chi2_per_dof_before)} → {plain_number(first.chi2_per_dof_after)}"
        words += f"; cross-validated, {_improvement(first)} (predictive χ²/dof {chi2})"
        words += "".join(f"; {_improvement(held)}" for held in others if held.rms_before > 0.0)
    return words + "."


def _improvement(held: HeldOut) -> str:
    """A domain with its rms without and with an effect, where it has one."""
    if held.rms_before == held.rms_after == 0.0:
        return quantity(held)
    before, after = (size_in_words(rms, held.unit) for rms in (held.rms_before, held.rms_after))
    return f"{quantity(held)} {before} → {after} rms"


def _remaining(diagnosis: Diagnosis) -> str:
    left = [d for d in diagnosis.remaining if d.disagrees]
    if not diagnosis.domains:
        return "Nothing was tested."
    if not left:
        beside = "beside the relation below" if diagnosis.relations else "in this recording"
        return f"Nothing detectable {beside}."
    said = [
        f"{MEANING[d.domain]}{(which := follows(diagnosis, d)) and ' ' + which}: χ²/dof {plain_number(d.chi2_per_dof)}"
        + (f", {place}" if (place := where_in_words(d)) else "")
        for d in left
    ]
    return capital("; ".join(said) + ".")


def _traces(diagnosis: Diagnosis) -> tuple[Picture, ...]:
    """Simulated and recorded readings, for a simulation with the recording's motion."""
    recording, simulated, segments = (getattr(diagnosis, name, None) for name in ("recording", "simulated", "segments"))
    if recording is None or simulated is None or segments is None:
        return ()
    return traces_picture(recording, simulated, segments)


def effect_pictures(diagnosis: Diagnosis) -> list[Picture]:
    """A picture of every effect that is a curve over one variable."""
    out = []
    for effect in diagnosis.effects:
        if effect.curves:
            dots = ", with what poses show (dots)" if any(len(one.data) for one in effect.curves) else ""
            caption = f"{capital(id_in_print(effect.id))}: what it adds, over the variable that drives it{dots}."
            out.append(Picture(f"effect-{effect.id}", caption, partial(effect_chart, effect.curves)))
    return out


def _picture(diagnosis: Diagnosis, residuals: DomainResiduals) -> Picture:
    """Residuals of one domain without and with the effects, with lines at poses that are not static."""
    caption = f"{_CAPTIONS[residuals.domain]} {_counted(residuals)}; ± 2 σ of the predicted noise."
    if residuals.domain == "dynamics":
        caption += " Velocity and angle of one move share most of their noise: χ² compares the rest of it."
    segments = getattr(diagnosis, "segments", None) if residuals.kind == "pose" else None
    lines = () if segments is None else pose_lines(segments, segments.time_mid_s)
    chart = partial(before_after_chart, residuals, has_effects=bool(diagnosis.effects), lines=lines)
    return Picture(residuals.domain, caption, chart)


def _counted(residuals: DomainResiduals) -> str:
    """Number of poses or moves as counted by calibration, and the additional rows due to disturbances."""
    n, n_rows = residuals.n_whole, len(residuals.before)
    said = how_many(n, residuals.kind)
    if residuals.kind == "move":
        return said + (f" and {how_many(n_rows - n, 'disturbance')} inside poses" if n_rows > n else "")
    return said + (f" in {n_rows} intervals, apart at disturbances" if n_rows > n else "")
