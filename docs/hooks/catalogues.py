"""The catalogues of findings and of effects as pages of the documentation."""

from itertools import groupby
from string import Formatter

from trihedron.report.effects.catalogue import CATALOGUE as EFFECTS
from trihedron.report.effects.words import EffectWords
from trihedron.report.findings.catalogue import ENTRIES
from trihedron.report.findings.entry import Entry
from trihedron.report.findings.wording import BRANCHES, branches

_HEAD = """# Findings

What the tool says about a recording is a closed list. Every finding has a code that keeps its meaning, a severity, what
was seen, the likely cause and the next action; the same five stand in reports, in `--json` and in Python
(`finding.code`, `.severity`, `.seen`, `.cause`, `.action`), with the values of the sentence in `numbers`.

| severity | means |
|---|---|
| note | stated so that nobody has to guess |
| warning | the answer stands, with less weight than it looks |
| serious | the answer is not to be trusted (exit status 2) |

Words in *italics* are values of the recording. Made from the catalogue (`python/trihedron/report/findings/`).
"""
_OF_EFFECTS = """# Effects

What a diagnosis can name is a closed list of mechanisms, each with an id that keeps its meaning; reports write it
in words (`accel-bias-drift` as *accelerometer bias drift*). What it says of one is
its mechanism with the strongest term, or the sentence that stands here, with values of the recording in *italics*; the
*separating experiment* is printed where a recording cannot separate two effects.
[A new effect](../adding-an-effect.md) is one file.

This page is made from the catalogue (`python/trihedron/report/effects/`).
"""


def page() -> str:
    """Markdown, by code in alphabetical order."""
    ordered = sorted(ENTRIES, key=lambda entry: (entry.code, entry.case))
    parts = [_HEAD]
    for code, entries in groupby(ordered, key=lambda entry: entry.code):
        parts.append(f"\n## {code}\n")
        parts += [_entry(entry) for entry in entries]
    return "".join(parts)


def _entry(entry: Entry) -> str:
    severity = entry.severity.value + (f" or {entry.or_severity.value}" if entry.or_severity else "")
    lines = [f"\n**{severity}**: {_shown(entry.seen)}"]
    if entry.cause:
        lines.append(f"*Likely:* {_shown(entry.cause)}")
    if entry.action:
        lines.append(f"*Do:* {_shown(entry.action)}")
    return "<br>\n".join(lines) + "\n"


def effects_page() -> str:
    """Markdown, by id in alphabetical order."""
    return _OF_EFFECTS + "".join(_effect(*entry) for entry in sorted(EFFECTS.items()))


def _effect(effect_id: str, entry: EffectWords) -> str:
    lines = [f"\n## {effect_id}\n\n{entry.mechanism[:1].upper()}{entry.mechanism[1:]}."]
    lines += [f"*Said:* {_shown(text)}" for text in entry.said.values()]
    lines.append(f"*Separating experiment:* {entry.experiment}.")
    return "<br>\n".join(lines) + "\n"


def _shown(template: str) -> str:
    """A sentence with the names of its values in place of the values, and both branches where it has two."""
    words = []
    for text, name, how, _ in Formatter().parse(template):
        words.append(text.replace("*", r"\*").replace("<", "&lt;"))
        if not name:
            continue
        if how and how[0] in BRANCHES:
            words.append("/".join(_shown(branch) for branch in branches(how) if branch))
        elif how and how.startswith("# "):
            words.append(f"*n* {how[2:]}(s)")
        else:
            number = how.removeprefix("all ").removeprefix("abs ") if how else ""
            unit = number.partition(" ")[2] if number[:1] in {".", "+"} else ""
            words.append(f"*{name.replace('_', ' ')}*" + (f" {unit}" if unit and unit[0] != "!" else ""))
    return "".join(words)
