"""The catalogue of effects as a page of the documentation."""

from trihedron.report.effects.catalogue import CATALOGUE
from trihedron.report.effects.words import EffectWords
from trihedron.report.findings.page import shown

_HEAD = """# Effects

What a diagnosis can name is a closed list of mechanisms, each with an id that keeps its meaning; reports write it
in words (`accel-bias-drift` as *accelerometer bias drift*). What it says of one is
its mechanism with the strongest term, or the sentence that stands here, with values of the recording in *italics*; the
*separating experiment* is printed where a recording cannot separate two effects.
[A new effect](../adding-an-effect.md) is one file.

This page is made from the catalogue (`python/trihedron/report/effects/`).
"""


def page() -> str:
    """Markdown, by id in alphabetical order."""
    return _HEAD + "".join(_entry(*entry) for entry in sorted(CATALOGUE.items()))


def _entry(effect_id: str, entry: EffectWords) -> str:
    lines = [f"\n## {effect_id}\n\n{entry.mechanism[:1].upper()}{entry.mechanism[1:]}."]
    lines += [f"*Said:* {shown(text)}" for text in entry.said.values()]
    lines.append(f"*Separating experiment:* {entry.experiment}.")
    if entry.static_experiment:
        lines.append(f"*In a log of one or two orientations:* {entry.static_experiment}.")
    return "<br>\n".join(lines) + "\n"
