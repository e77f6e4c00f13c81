"""The catalogue of findings as a page of the documentation."""

from itertools import groupby
from string import Formatter

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


def page() -> str:
    """Markdown, by code in alphabetical order."""
    ordered = sorted(ENTRIES, key=lambda entry: (entry.code.value, entry.case))
    parts = [_HEAD]
    for code, entries in groupby(ordered, key=lambda entry: entry.code.value):
        parts.append(f"\n## {code}\n")
        parts += [_entry(entry) for entry in entries]
    return "".join(parts)


def _entry(entry: Entry) -> str:
    severity = entry.severity.value + (f" or {entry.or_severity.value}" if entry.or_severity else "")
    lines = [f"\n**{severity}**: {shown(entry.seen)}"]
    if entry.cause:
        lines.append(f"*Likely:* {shown(entry.cause)}")
    if entry.action:
        lines.append(f"*Do:* {shown(entry.action)}")
    return "<br>\n".join(lines) + "\n"


def shown(template: str) -> str:
    """A sentence with the names of its values in place of the values, and both branches where it has two."""
    words = []
    for text, name, how, _ in Formatter().parse(template):
        words.append(text.replace("*", r"\*").replace("<", "&lt;"))
        if not name:
            continue
        if how and how[0] in BRANCHES:
            words.append("/".join(shown(branch) for branch in branches(how) if branch))
        elif how and how.startswith("# "):
            words.append(f"*n* {how[2:]}(s)")
        else:
            number = how.removeprefix("all ").removeprefix("abs ") if how else ""
            unit = number.partition(" ")[2] if number[:1] in {".", "+"} else ""
            words.append(f"*{name.replace('_', ' ')}*" + (f" {unit}" if unit and unit[0] != "!" else ""))
    return "".join(words)
