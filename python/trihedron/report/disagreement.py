"""Report of the demonstration's second act: a simulation that a log contradicts, the cause, and the correction."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.records.diagnosis import Diagnosis
from trihedron.report.diagnosis import effects_blocks
from trihedron.report.diagnosis_numbers import differing_numbers, stages_blocks
from trihedron.report.diagnosis_words import MEANING, verdict_in_words
from trihedron.report.document import Block, Document, Facts, Paragraph, Section
from trihedron.report.numbers import listed, plain_number

_MOST_NUMBERS = 6


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
    told = tuple(("", word) for word in numbers[:_MOST_NUMBERS]) + ((("", f"and {more} more"),) if more > 0 else ())
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
            Section("Parameters: this unit differs from the data sheet", (Facts(told or (("", "none differs"),)),)),
            Section("Physics: effects missing from the simulation", effects_blocks(found)),
            Section("Stage by stage", stages_blocks(found, MEANING)),
            Section("The improved simulation, compared with the same log", (Paragraph(verdict_in_words(improved)),)),
            Section("The drawn effect", (*_opened(sealed, sizes), Paragraph(answer))),
            Section("Files", (_files(folder),)),
        ),
    )


def _opened(sealed: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Any]]) -> tuple[Block, ...]:
    said = sizes.get(str(sealed["effect"]), {})
    rows = [("drawn", str(sealed["effect"]))]
    for key, true in sealed["size"].items():
        rows.append((key, f"drawn {_numbers(true)}; found {_numbers(said[key]) if key in said else '–'}"))
    return (Facts(tuple(rows)),)


def _numbers(value: Any) -> str:
    flat = np.ravel(np.asarray(value, dtype=np.float64))
    return listed([plain_number(float(v), 3) for v in flat])


def _files(folder: Path) -> Facts:
    return Facts(
        (
            (str(folder / "unit.csv"), "the log of the unit"),
            (str(folder / "simulation.toml"), "the simulation as it was"),
            (str(folder / "improved.toml"), "the simulation with the parameters of the log; your comments stay"),
            (str(folder / "disagreement.html"), "the whole diagnosis, with figures"),
            (str(folder / "sealed.json"), "what was drawn"),
        )
    )
