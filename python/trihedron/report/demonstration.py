"""Report of the demonstration: a calibration against its truth, and a simulation that a log contradicts."""

import re
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.records import Comparison
from trihedron.records.results import DiagnosisResult
from trihedron.report.calibration import shared_power
from trihedron.report.diagnosis import diagnosis_report, first_screen
from trihedron.report.diagnosis_words import verdict_in_words
from trihedron.report.document import Document, Facts, Paragraph, Section, Table
from trihedron.report.names import id_in_print
from trihedron.report.numbers import in_mm_s2, plain_number, with_sigma

_NEXT_STEPS = (
    ("is it fit?", "trihedron check LOG"),
    ("calibrate", "trihedron calibrate LOG --latitude DEG -o calibration.json --report report.html"),
    ("use it", "trihedron apply calibration.json LOG -o corrected.csv"),
)
_OF_CALIBRATION = {
    "session.csv": "the log that was calibrated: time and raw counts",
    "calibration.json": "the calibration with its covariance and findings",
    "report.html": "the report, with figures; open it in a browser",
    "second-session.csv": "another session of the same sensor",
    "verification.html": "the calibration tested on it",
    "truth.json": "what the simulated sensor is really made of",
}
_OF_DISAGREEMENT = {
    "unit.csv": "the log of the unit",
    "simulation.toml": "the simulation as it was",
    "improved.toml": "the simulation with the parameters of the log; your comments stay",
    "disagreement.html": "the whole diagnosis, with figures",
    "sealed.json": "what was drawn",
}


def demonstration_report(comparison: Comparison, before_m_s2: float, after_m_s2: float, folder: Path) -> Document:
    """Lay out the gravity error before and after calibration, and every parameter beside the truth."""
    z, n = np.abs(comparison.z), len(comparison.names)
    within = int(np.sum(z < 2.0))
    coverage = (
        f"Within 1 σ: {int(np.sum(z < 1.0))} of {n} (expected: {round(0.683 * n)}); within 2 σ: {within} of {n} (about "
        f"{round(0.954 * n)}). With all correlations χ² is {plain_number(comparison.chi2)} for {n} parameters. The "
        "truth of a bias is its mean in this session."
    )
    return Document(
        title="A complete session, on a simulated sensor",
        subtitle="A 16-bit MEMS part, set down by hand in 24 poses; only this comparison uses the truth.",
        verdict=f"Gravity error in static poses of a session that the calibration has not seen: "
        f"{in_mm_s2(before_m_s2)} rms before, {in_mm_s2(after_m_s2)} after. {within} of {n} parameters lie within 2 σ "
        "of the truth.",
        sections=(
            Section("Compare with the truth", (_truth_table(comparison), Paragraph(coverage))),
            Section("Files", (_files(folder, _OF_CALIBRATION),)),
            Section("Your own sensor", (Facts(_NEXT_STEPS),)),
        ),
    )


def _truth_table(comparison: Comparison) -> Table:
    rows = []
    for k, name in enumerate(comparison.names):
        sensor, parameter = name.split(".")
        # S of one sensor shares a power of ten, so that its rows can be compared.
        is_peer = [other.startswith(f"{sensor}.{parameter[0]}") for other in comparison.names]
        scale, times = shared_power(comparison.truth[is_peer])
        sigma = scale * comparison.sigma[k]
        rows.append(
            (
                f"{sensor} {parameter}",
                with_sigma(scale * comparison.truth[k], sigma).split(" ±")[0] + times,
                with_sigma(scale * comparison.estimate[k], sigma) + times,
                f"{comparison.z[k]:+.1f}".replace("-", "−"),
            )
        )
    return Table(("", "truth", "estimate ± σ", "error in σ"), tuple(rows), "Every parameter beside the truth")


def _files(folder: Path, what: Mapping[str, str]) -> Facts:
    return Facts(tuple((str(folder / name), said) for name, said in what.items()))


def with_files(page: Document, **files: object) -> Document:
    """The page with the demonstration's own files for LOG, OTHER_LOG and FILE of its next step."""
    words = {name: shlex.quote(str(path)) for name, path in files.items()}
    return replace(page, next_step=re.sub(r"\b[A-Z_]+\b", lambda word: words.get(word[0], word[0]), page.next_step))


def disagreement_report(
    found: DiagnosisResult, improved: DiagnosisResult, sealed: Mapping[str, Any], folder: Path
) -> Document:
    """The first screen of the diagnosis, the verdict on the improved simulation, and the answer."""
    page = diagnosis_report(found)
    answer = "Not found: another effect is named first."
    if [effect.id for effect in found.effects][:1] == [sealed["effect"]]:
        answer = "Found: it is the first effect named."
    elif any(sealed["effect"] in effect.confounded_with for effect in found.effects[:1]):
        answer = "It is confounded with the first one named in this recording, and the report says so."
    drawn = ", ".join(f"{key} {plain_number(float(v))}" for key, size in sealed["size"].items() for v in np.ravel(size))
    said = f"{id_in_print(sealed['effect'])} ({drawn}), drawn at random: `--seed {sealed['seed']}` repeats it. {answer}"
    sections = (
        *page.sections[: first_screen(found)],
        Section("The improved simulation, compared with the same log", (Paragraph(verdict_in_words(improved)),)),
        Section("The drawn effect", (Paragraph(f"{said[:1].upper()}{said[1:]}"),)),
        Section("Files", (_files(folder, _OF_DISAGREEMENT),)),
    )
    return replace(page, title="A simulation and a log that disagree", sections=sections, next_step="")
