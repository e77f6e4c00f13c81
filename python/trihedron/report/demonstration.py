"""Report of the demonstration: a session against its truth, and a simulation that a log contradicts."""

import re
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.records import Calibration, Comparison, Finding, Recording, Segments, Severity, Verification
from trihedron.records.diagnosis import Diagnosis
from trihedron.report.calibration import parameter_table, shared_power
from trihedron.report.diagnosis import effects_blocks
from trihedron.report.diagnosis_numbers import differing_numbers, stages_blocks
from trihedron.report.diagnosis_words import verdict_in_words
from trihedron.report.document import Block, Document, Facts, Paragraph, Section, Table
from trihedron.report.findings import findings_block
from trihedron.report.names import MEANING, id_in_print
from trihedron.report.numbers import (
    duration,
    in_mm_s2,
    listed,
    plain_number,
    with_sigma,
)
from trihedron.report.verification import facts_of

_MOST_NUMBERS = 6
_NEXT_STEPS = (
    ("is it fit?", "trihedron check LOG"),
    ("calibrate", "trihedron calibrate LOG --latitude DEG -o calibration.json --report report.html"),
    ("use it", "trihedron apply calibration.json LOG -o corrected.csv"),
)
_FILES = {
    "unit.csv": "the log of the unit",
    "simulation.toml": "the simulation as it was",
    "improved.toml": "the simulation with the parameters of the log; your comments stay",
    "disagreement.html": "the whole diagnosis, with figures",
    "sealed.json": "what was drawn",
}


def demonstration_report(
    calibration: Calibration,
    segments: Segments,
    recording: Recording,
    verification: Verification,
    comparison: Comparison,
    uncalibrated_rms_m_s2: float,
    latitude_deg: float,
    files: tuple[tuple[Path, str], ...],
) -> Document:
    before = f"{in_mm_s2(uncalibrated_rms_m_s2)} rms with the data sheet's scale"
    verified = (("gravity error before", before), *facts_of(verification))
    return Document(
        title="A complete session, on a simulated sensor",
        subtitle="Everything below was computed from the CSV log; only section 4 uses the truth.",
        verdict=_verdict(comparison, verification, uncalibrated_rms_m_s2),
        is_trustworthy=calibration.is_trustworthy,
        sections=(
            Section("1  The session", (Paragraph(_session(segments, recording)),)),
            Section("2  Calibrate", _calibrated(calibration, latitude_deg)),
            Section("3  Verify on another session", (Facts(verified), *_warnings(verification.findings))),
            Section("4  Compare with the truth", (_truth_table(comparison), Paragraph(_coverage(comparison)))),
            Section("5  Files", (Facts(tuple((str(path), what) for path, what in files)),)),
            Section("Your own sensor", (Facts(_NEXT_STEPS),)),
        ),
    )


def _verdict(comparison: Comparison, verification: Verification, before: float) -> str:
    within = int(np.sum(np.abs(comparison.z) < 2.0))
    return (
        f"Gravity error in static poses of a session that the calibration has not seen: {in_mm_s2(before)} rms "
        f"before, {in_mm_s2(verification.norm_rms)} after. {within} of {len(comparison.names)} parameters lie "
        "within 2 σ of the truth."
    )


def _session(segments: Segments, recording: Recording) -> str:
    still = float(np.sum(segments.duration_s))
    return (
        "A person picks up a 16-bit MEMS IMU and sets it down by hand in one pose after another: faces and edges of "
        f"its case and some tilts between, no angle measured. After {duration(recording.duration_s)} the log contains "
        f"{recording.n_samples} rows of raw counts at {plain_number(recording.rate_hz, 4)} Hz; the sensor's own "
        f"noise separates {segments.n_poses} poses ({duration(still)} in all) from {len(segments.moves)} moves; no "
        "threshold was set."
    )


def _calibrated(calibration: Calibration, latitude_deg: float) -> tuple[Block, ...]:
    said = (
        f"Only gravity had to be given: latitude {latitude_deg:g}° means {calibration.gravity_m_s2:.5f} m/s². The "
        "calibrated accelerometer must read that length in every pose, and the calibrated gyro must predict the "
        "direction of gravity after every rotation. One fit of both gives:"
    )
    tables = (parameter_table(name, sensor) for name, sensor in calibration.sensors)
    return (Paragraph(said), *tables, *_warnings(calibration.findings))


def _warnings(findings: tuple[Finding, ...]) -> tuple[Block, ...]:
    """Findings above a note; notes are in the reports."""
    grave = tuple(finding for finding in findings if finding.severity is not Severity.NOTE)
    return (findings_block(grave),) if grave else ()


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


def _coverage(comparison: Comparison) -> str:
    z = np.abs(comparison.z)
    n = len(z)
    return (
        f"Within 1 σ: {int(np.sum(z < 1.0))} of {n} (expected: {round(0.683 * n)}); within 2 σ: "
        f"{int(np.sum(z < 2.0))} of {n} (about {round(0.954 * n)}). With all correlations χ² is "
        f"{plain_number(comparison.chi2)} for {n} parameters. The truth of a bias is its mean in this session."
    )


def with_files(page: Document, **files: object) -> Document:
    """The page with the demonstration's own files for LOG, OTHER_LOG and FILE of its next step."""
    words = {name: shlex.quote(str(path)) for name, path in files.items()}
    return replace(page, next_step=re.sub(r"\b[A-Z_]+\b", lambda word: words.get(word[0], word[0]), page.next_step))


def disagreement_report(
    found: Diagnosis,
    improved: Diagnosis,
    sealed: Mapping[str, Any],
    sizes: Mapping[str, Mapping[str, Any]],
    folder: Path,
    seed: int,
) -> Document:
    """Lay out the disagreement, differing parameters and missing effects, the improved simulation, the answer."""
    numbers = differing_numbers(found)
    more = len(numbers) - _MOST_NUMBERS
    words = [*numbers[:_MOST_NUMBERS], *([f"and {more} more"] if more > 0 else ())]
    said = [("", word) for word in words or ["none differs"]]
    is_right = [e.id for e in found.effects][:1] == [sealed["effect"]]
    beside = any(sealed["effect"] in e.confounded_with for e in found.effects[:1])
    answer = "Found: it is the first effect named." if is_right else "Not found: another effect is named first."
    if beside:
        answer = "The drawn effect is confounded with the first one named in this recording, and the report says so."
    return Document(
        title="A simulation and a log that disagree",
        subtitle=f"One effect, drawn at random (--seed {seed} repeats it), was sealed before the diagnosis.",
        verdict=verdict_in_words(found),
        is_trustworthy=True,
        sections=(
            Section("Parameters: this unit differs from the data sheet", (Facts(tuple(said)),)),
            Section("Physics: effects missing from the simulation", effects_blocks(found)),
            Section("Stage by stage", stages_blocks(found, MEANING)),
            Section("The improved simulation, compared with the same log", (Paragraph(verdict_in_words(improved)),)),
            Section("The drawn effect", (*_opened(sealed, sizes), Paragraph(answer))),
            Section("Files", (Facts(tuple((str(folder / name), what) for name, what in _FILES.items())),)),
        ),
    )


def _opened(sealed: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Any]]) -> tuple[Block, ...]:
    said = sizes.get(str(sealed["effect"]), {})
    rows = [("drawn", id_in_print(str(sealed["effect"])))]
    for key, true in sealed["size"].items():
        rows.append((key, f"drawn {_numbers(true)}; found {_numbers(said[key]) if key in said else '–'}"))
    return (Facts(tuple(rows)),)


def _numbers(value: Any) -> str:
    flat = np.ravel(np.asarray(value, dtype=np.float64))
    return listed([plain_number(float(v), 3) for v in flat])
