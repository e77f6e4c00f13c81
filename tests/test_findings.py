"""The catalogue of findings is closed: stages give codes and values, every sentence stands under report/."""

import ast
import itertools
import re
from functools import cache

import numpy as np
import pytest
from catalogues import page

from test_architecture import PACKAGE, no_search_for_garbage, nodes  # noqa: F401
from trihedron.records import Finding, Severity
from trihedron.report.effects.catalogue import CATALOGUE as EFFECTS
from trihedron.report.findings.catalogue import CATALOGUE, ENTRIES
from trihedron.report.findings.phrases import PHRASES
from trihedron.report.findings.wording import filled, places


@cache
def _calls(attribute):
    """Calls of ``Finding.of`` (or of ``Finding`` itself) with the file they stand in."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        name = str(path.relative_to(PACKAGE))
        for node in (node for node in nodes(path) if isinstance(node, ast.Call) and not name.startswith("report/")):
            called = node.func
            if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name):
                is_one = attribute and called.value.id == "Finding" and called.attr == "of"
            else:
                is_one = not attribute and isinstance(called, ast.Name) and called.id == "Finding"
            if is_one:
                found.append((name, node))
    return found


def _choices(node):
    """What an argument may be: a literal, or one of two; None where only the run decides."""
    if isinstance(node, ast.IfExp):
        one, other = _choices(node.body), _choices(node.orelse)
        return None if one is None or other is None else one | other
    if isinstance(node, ast.Constant):
        return {node.value}
    return None


def _created():
    """(file, line, codes, cases, names of the values, severities) of every finding that a stage makes."""
    for name, node in _calls(attribute=True):
        codes = _choices(node.args[0])
        cases = _choices(node.args[1]) if len(node.args) > 1 else {""}
        assert codes is not None, f"{name}:{node.lineno}: which code is it?"
        if cases is None:
            start = node.args[1].values[0].value if isinstance(node.args[1], ast.JoinedStr) else ""
            cases = {case for code, case in CATALOGUE if code in codes and case.startswith(start)}
        given = {keyword.arg for keyword in node.keywords} - {"severity", "numbers"}
        yield f"{name}:{node.lineno}", codes, cases, given, node


def test_every_finding_of_a_stage_is_in_the_catalogue_with_its_places_and_severities():
    for where, codes, cases, given, node in _created():
        stated = [keyword.value for keyword in node.keywords if keyword.arg == "severity"]
        for key in itertools.product(codes, cases):
            assert key in CATALOGUE, f"{where}: {key} is not in the catalogue"
            entry = CATALOGUE[key]
            assert given >= entry.places, f"{where}: {key}"
            for value in stated:
                names = {n.attr for n in ast.walk(value) if isinstance(n, ast.Attribute)} & set(Severity.__members__)
                assert names == {entry.severity.name, entry.or_severity.name}, where


def test_no_finding_is_written_outside_the_report():
    assert not _calls(attribute=False)
    for name, node in _calls(attribute=True):
        for keyword in (k for k in node.keywords if k.arg != "numbers"):
            for part in ast.walk(keyword.value):
                text = part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else ""
                assert " " not in text, f"{name}:{node.lineno}: a sentence belongs into the catalogue"
                assert not isinstance(part, ast.JoinedStr), f"{name}:{node.lineno}"


def test_every_entry_of_the_catalogue_is_created_somewhere_and_once_in_the_table():
    created = {(code, case) for _, codes, cases, _, _ in _created() for code in codes for case in cases}
    assert set(CATALOGUE) == created
    assert len(ENTRIES) == len(CATALOGUE)


def test_no_stage_looks_for_a_code_that_no_finding_has():
    codes = {code for code, _ in CATALOGUE}
    # Effects have codes' form, and some have a finding of the same name.
    known = codes | set(EFFECTS)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in (one for one in nodes(path) if isinstance(one, ast.Compare | ast.Set)):
            compared = isinstance(node, ast.Compare) and getattr(node.left, "attr", "") == "code"
            group = "elts" if isinstance(node, ast.Set) else "comparators" if compared else ""
            # What is compared with is a literal, or a collection of them.
            parts = [part for one in getattr(node, group, ()) for part in (ast.walk(one) if compared else [one])]
            words = {one.value for one in parts if isinstance(one, ast.Constant) and isinstance(one.value, str)}
            if compared or any("-" in word for word in words & codes - set(EFFECTS)):
                assert words <= known, f"{path.name}:{node.lineno}: {words - known}"


def test_a_finding_carries_its_numbers_for_machines():
    found = Finding.of("few-poses", poses=np.int64(1), duration_s=np.float64(12.5), needed=9, least_s=1.0)
    assert found.seen.startswith("1 pose found in 12.5 s")
    assert found.severity is Severity.WARNING
    assert dict(found.numbers) == {"poses": 1.0, "duration_s": 12.5, "needed": 9.0, "least_s": 1.0}


def test_the_documents_list_the_catalogue_as_it_is():
    assert set(re.findall(r"^## (\S+)$", page(), re.MULTILINE)) == {entry.code for entry in ENTRIES}


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("{x:.2g %}", 0.034, "3.4 %"),
        ("{x:.3g mm/s²}", 0.0123, "12.3 mm/s²"),
        ("{x:.2g mg}", 9.80665e-3, "1 mg"),
        ("{x:.2g ms}", 0.0021, "2.1 ms"),
        ("{x:.2g cm}", 0.15, "15 cm"),
        ("{x:.2g deg}", 0.5 * np.pi, "90°"),
        ("{x:abs .1f °/s}", -np.pi / 180.0, "1.0 °/s"),
        ("{x:all .1f mg}", (9.80665e-3, 0.0196133), "1.0, 2.0 mg"),
        ("{x:# pose}", 1, "1 pose"),
        ("{x:# pose}", 0, "0 poses"),
        ("{x:first 2}", ("a", "b"), "a, b"),
        ("{x:first 2}", ("a", "b", "c"), "a, b and 1 more"),
        ("{x:together}", ("a",), "a"),
        ("{x:together}", ("a", "b"), "a, b in combination"),
        ("{x:numbered}", ("a", "b"), "(1) a; (2) b"),
        ("{x:axes and}", (1, 3), "X and Z"),
        ("{x:?one|{x:.0f} of them}", 1, "one"),
        ("{x:?one|{x:.0f} of them}", 2, "2 of them"),
        ("{x:<less|more}", -1e-9, "less"),
        ("{x:<less|more}", 0.0, "more"),
    ],
)
def test_a_place_in_a_sentence_takes_si_and_says_its_unit_its_number_and_its_branch(place, value, said):
    assert filled(place, {"x": value}, {}) == said


def test_every_phrase_of_a_stage_is_in_the_catalogue_with_its_places_and_every_phrase_is_used():
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in (one for one in nodes(path) if isinstance(one, ast.Call)):
            if not (isinstance(node.func, ast.Name) and node.func.id in {"words", "remarked"}):
                continue
            name = node.args[-1]
            given = {keyword.arg for keyword in node.keywords} | ({"ratio"} if node.func.id == "remarked" else set())
            for phrase in _choices(name) or ():
                assert phrase in PHRASES, f"{path.name}:{node.lineno}: {phrase}"
                assert None in given or given >= places(PHRASES[phrase]), f"{path.name}:{node.lineno}: {phrase}"
    # Reasons of a stop are named by the core.
    sources = [path for path in PACKAGE.rglob("*.py") if path.parent.name != "findings"]
    texts = "\n".join(path.read_text() for path in [*sources, *(PACKAGE.parents[1] / "rust").rglob("*.rs")])
    assert {phrase for phrase in PHRASES if f'"{phrase}"' not in texts} == set()


def test_a_value_beside_its_uncertainty_has_the_digits_of_the_uncertainty():
    place = "up to {rate:± sigma °/s} per g"
    assert places(place) == {"rate", "sigma"}
    # 0.16 alone would hide that the third digit is known.
    assert (
        filled(place, {"rate": np.radians(0.16), "sigma": np.radians(0.0047)}, {}) == "up to 0.1600 ± 0.0047 °/s per g"
    )
