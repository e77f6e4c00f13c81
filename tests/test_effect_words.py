"""What is said of effects is a closed catalogue under report/: effects give ids, cases and values."""

import ast
import inspect
import re
import textwrap
from pathlib import Path

import pytest

from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Effect
from trihedron.records.diagnosis import EffectParameter
from trihedron.report.effects.catalogue import CATALOGUE, REASONS
from trihedron.report.effects.page import page
from trihedron.report.findings.wording import places

ROOT = Path(__file__).parents[1]
DIAGNOSE = ROOT / "python" / "trihedron" / "diagnose"
STATIC = {"static", "static-counts"}


def ours():
    """Effects of the package: other tests may have added their own."""
    return [effect for effect in catalogue() if type(effect).__module__.startswith("trihedron.")]


def cases_of(effect):
    """(case or None where only the run decides, names of the values) of every sentence that an effect can request."""
    for kind in type(effect).__mro__:
        if kind in (Effect, object) or not kind.__module__.startswith("trihedron.diagnose.effects"):
            continue
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(kind)))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "reported":
                case = node.args[0].value if isinstance(node.args[0], ast.Constant) else None
                yield case, {keyword.arg for keyword in node.keywords}


def test_every_effect_has_its_words_and_every_word_its_effect():
    assert set(CATALOGUE) == {effect.id for effect in ours()}
    assert all(entry.mechanism and entry.experiment for entry in CATALOGUE.values())
    assert set(re.findall(r"^## (\S+)$", page(), re.MULTILINE)) == set(CATALOGUE)


def test_an_effect_asks_for_exactly_the_sentences_and_places_of_the_catalogue():
    asked = 0
    for effect in ours():
        said, seen = dict(CATALOGUE[effect.id].said), set()
        for case, given in cases_of(effect):
            # A case that the run chooses: each that nothing else requests takes these values.
            for one in [case] if case else set(said) - STATIC:
                assert places(said[one]) == given, f"{effect.id} '{one}'"
                seen.add(one)
        assert seen == set(said) - STATIC, effect.id
        asked += len(seen)
    assert asked > 15


def test_every_reason_is_given_somewhere_and_with_its_places():
    given = {}
    for path in DIAGNOSE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "why_not":
                name = node.args[0].value
                given[name] = {keyword.arg for keyword in node.keywords}
                assert places(REASONS[name]) == given[name], f"{path.name}: {name}"
    assert set(given) == set(REASONS)


class Own(Effect):
    """As a user's file adds one, but without an id of its own: it stays out of the catalogue."""

    mechanism = "the readings follow the moon"
    experiment = "wait a fortnight"

    def variants(self, context):  # noqa: ARG002
        return []


def test_an_effect_of_a_users_own_file_brings_its_own_words():
    own = Own()
    own.id = "moon"
    strongest = (EffectParameter("m_x", 1.0, 0.5, "1"), EffectParameter("m_y", 2.0, 0.1, "m/s^2"))
    assert own.statement(strongest) == "the readings follow the moon (strongest term m_y: 2 ± 0.1 m/s²)."
    assert own.separating_experiment() == "wait a fortnight"
    with pytest.raises(KeyError):
        own.reported("no such case")
