"""Findings in words: the closed catalogue of sentences; findings in reading order, merged, and their verdict."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

from trihedron.records import Finding, Severity
from trihedron.report.document import Document, FindingList, Paragraph
from trihedron.report.findings.wording import opening
from trihedron.report.names import finding_in_print
from trihedron.report.numbers import MINUS, capital, listed

STATED = "Stated above."
"""A finding whose sentence is in the verdict."""
_ORDER = {Severity.SERIOUS: 0, Severity.WARNING: 1, Severity.NOTE: 2}
# A number that is a value; a number in a name (pose 3) is recognised by the word before it.
_NUMBER = re.compile(r"(?<![\w.])[+−-]?\d+(?:\.\d+)?(?:e[+−-]?\d+)?")
_NAMED = re.compile(r"^(Move|Pose|Turn) (\d+(?: at [\d.]+ s)?)(?: \([^)]*\))?,? (.*)$", re.DOTALL)
_AXIS = re.compile(r"^((?:gyro|accel)(?:\s\w+)?|ch\d+|\w+ [xyz123]): (.*)$", re.DOTALL | re.IGNORECASE)


def findings_block(findings: Iterable[Finding]) -> FindingList | Paragraph:
    """Findings, gravest first, within a severity in the order of the stages; equal ones merged."""
    ordered = by_weight(findings)
    sentences = tuple(replace(one, seen=capital(one.seen), cause=capital(one.cause)) for one in ordered)
    return FindingList(sentences) if sentences else Paragraph("None.")


def by_weight(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings, equal ones merged, gravest first."""
    # Gravity that was not given comes after all else that is wrong.
    return tuple(sorted(combined(findings), key=lambda f: (_ORDER[f.severity], f.code == "gravity-defaulted")))


def serious_ones(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The serious findings, the one of the verdict first."""
    return tuple(one for one in by_weight(findings) if one.severity is Severity.SERIOUS)


def verdict_of(findings: Iterable[Finding], good: str, usable: str, bad: str) -> str:
    """``bad`` with the first clause of the gravest finding and its cause; ``usable`` with the warnings by name; or
    ``good``."""
    found = by_weight(findings)
    serious = [one for one in found if one.severity is Severity.SERIOUS]
    warned = Counter(finding_in_print(one.code) for one in found if one.severity is Severity.WARNING)
    if serious:
        return " ".join(filter(None, (f"{bad}: {capital(opening(serious[0].seen))}.", likely(serious[0].cause))))
    if not warned:
        return good
    named = [name if n == 1 else f"{name} ({n})" for name, n in warned.items()]
    return f"{usable}, with {'a warning' if warned.total() == 1 else 'warnings'}: {listed(named)}."


def likely(cause: str) -> str:
    """A cause as a sentence after an observation; empty where there is none."""
    return f"Likely: {cause[:1].lower()}{cause[1:]}" if cause else ""


def beyond_headline(finding: Finding, document: Document, above: str = f"{STATED} ") -> Finding:
    """What verdict and next action of the document have not stated of a finding; unchanged where they do not."""
    if finding is not document.foremost:
        return finding
    clause = opening(finding.seen)
    rest = finding.seen[len(clause) :].lstrip(" .;")
    is_stated = clause.lower() in document.verdict.lower()
    seen = f"{above}{capital(rest)}".rstrip() if is_stated else finding.seen
    is_next = bool(finding.action) and finding.action[1:].partition("`")[0] in document.what_next
    cause = "" if likely(finding.cause) in document.verdict else finding.cause
    return replace(finding, seen=seen, cause=cause, action="" if is_next else finding.action)


def combined(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings with those that several axes, poses or moves have in common merged into one that lists them."""
    groups: dict[tuple[str, str, str, str], list[Finding]] = {}
    for finding in findings:
        key = (finding.code, finding.severity.value, finding.cause, finding.action)
        groups.setdefault(key, []).append(finding)
    return tuple(
        same[0] if len(same) == 1 else replace(same[0], seen=_together([f.seen for f in same]))
        for same in groups.values()
    )


def _together(sentences: Sequence[str]) -> str:
    """One sentence for all that differ only in their subject and numbers; else one after another."""
    for pattern, name in ((_AXIS, _axes), (_NAMED, _things)):
        parts = [pattern.match(text) for text in sentences]
        if all(parts):
            # What one axis has twice is no range: the first of every axis, then the second.
            named = ["" if part is None else part[0][: part.start(part.re.groups)] for part in parts]
            count = [named[:k].count(one) for k, one in enumerate(named)]
            if any(count):
                each = (
                    [text for text, at in zip(sentences, count, strict=True) if at == k] for k in range(max(count) + 1)
                )
                return " ".join(_together(some) for some in each)
            rest = ranged([part[part.re.groups] for part in parts if part is not None])
            if rest is not None:
                return name([part for part in parts if part is not None], rest)
    whole = ranged(sentences)
    if whole is not None and not re.search(r"\b(pose|move|sample|line|axis)s? \d", sentences[0], re.IGNORECASE):
        return whole
    return " ".join(map(capital, sentences))


def _axes(parts: Sequence[re.Match[str]], rest: str) -> str:
    """``Gyro X, Y and Z: above 0.8 to 1.1 Hz ...``"""
    groups: dict[str, list[str]] = {}
    for part in parts:
        sensor, _, axis = part[1].partition(" ")
        groups.setdefault(sensor, []).append(axis)
    words = [f"{sensor} {listed(axes)}".strip() for sensor, axes in groups.items()]
    return f"{capital(', '.join(words))}: {rest[:1].lower()}{rest[1:]}"


def _things(parts: Sequence[re.Match[str]], rest: str) -> str:
    """``Moves 7, 9 and 22: each has a tilt error of ...``"""
    return f"{parts[0][1]}s {listed([part[2] for part in parts])}: each {rest}"


def ranged(sentences: Sequence[str]) -> str | None:
    """The common sentence with ranges in place of numbers that differ; None where the texts differ."""
    skeleton = _NUMBER.sub("\0", sentences[0])
    if any(_NUMBER.sub("\0", text) != skeleton for text in sentences[1:]):
        return None
    columns = list(zip(*(_NUMBER.findall(text) for text in sentences), strict=True))
    words = []
    for column in columns:
        low, high = min(column, key=_value), max(column, key=_value)
        words.append(low if low == high else f"{low} to {high}")
    pieces = skeleton.split("\0")
    return pieces[0] + "".join(word + piece for word, piece in zip(words, pieces[1:], strict=True))


def _value(number: str) -> float:
    return float(number.replace(MINUS, "-"))
