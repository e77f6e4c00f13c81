"""Main figures of a diagnosis: parameters that differ, the misfit that effects explain, the worst residual."""

from trihedron.records.diagnosis import Diagnosis
from trihedron.report.diagnosis_numbers import n_differing
from trihedron.report.diagnosis_words import (
    MOST_NAMED,
    NOT_JUDGED,
    judged_in_words,
    p_in_words,
    quantity,
    rms_in_words,
    size_in_words,
)
from trihedron.report.document import Headline
from trihedron.report.names import MEANING, id_in_print
from trihedron.report.numbers import plain_number

LEAST_SHARE = 0.005
"""Smallest share of the misfit that is printed."""


def differing_headline(diagnosis: Diagnosis) -> tuple[Headline, ...]:
    """Number of parameters of the model that differ from the recording's."""
    n_off = n_differing(diagnosis)
    if not n_off:
        return ()
    return (Headline("parameters that differ", str(n_off), "", f"of {len(diagnosis.parameters)} compared"),)


def headlines_of(diagnosis: Diagnosis) -> tuple[Headline, ...]:
    """Share of the misfit of every effect, and the cross-validated gain of the strongest; else the worst domain."""
    explained = [(id_in_print(effect.id), 100.0 * (effect.share or 0.0)) for effect in diagnosis.effects]
    shares = tuple(
        Headline(f"{name} explains", plain_number(share, 2), "%", "of the misfit by itself")
        for name, share in explained
        if share > 100.0 * LEAST_SHARE
    )
    for k, effect in enumerate(diagnosis.effects):
        if effect.held_out and effect.side == "recording":
            held = effect.held_out[0]
            after, _, unit = size_in_words(held.rms_after, held.unit).partition(" ")
            before = size_in_words(held.rms_before, held.unit)
            return (
                *shares[:MOST_NAMED],
                Headline(quantity(held), after, unit, f"cross-validated, with {explained[k][0]}; {before} without"),
            )
    tests = [d for d in diagnosis.domains if d.dof > 0]
    if not tests:
        return ()
    worst = min((d for d in tests if d.disagrees), key=lambda d: d.p_value, default=tests[0])
    is_open = judged_in_words(diagnosis, worst) == NOT_JUDGED
    judged = "1 by noise alone; " + (NOT_JUDGED if is_open else f"p {p_in_words(worst.p_value)}")
    chi2 = plain_number(worst.chi2_per_dof)
    if not worst.unit:
        return (Headline(f"{MEANING[worst.domain]}, χ²/dof", chi2, "", judged),)
    size, _, unit = rms_in_words(worst).partition(" ")
    of = "rms" if getattr(diagnosis, "model_is_given", False) else "rms in sample"
    return (Headline(MEANING[worst.domain], size, unit, f"{of}; χ²/dof {chi2}, {judged}"),)
