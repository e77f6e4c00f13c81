"""What is said of effects is a closed catalogue under report/: effects give ids, cases and values."""

import ast
import inspect
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Effect
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words, effect_words, why_not
from trihedron.report.effects import laws
from trihedron.report.effects.catalogue import CATALOGUE, ENTRIES, OF_ANY
from trihedron.report.effects.page import page
from trihedron.report.effects.reasons import REASONS
from trihedron.report.findings.phrases import PHRASES
from trihedron.report.findings.wording import places

ROOT = Path(__file__).parents[1]
DIAGNOSE = ROOT / "python" / "trihedron" / "diagnose"
AT_REST = {"at-rest", "at-rest-counts"}
# Names of variants, which are data: they stand in a diagnosis for machines.
NAMES = re.compile(r"[, ]+ms|(accelerometer|gyro), per axis|second order|common scale")


def ours():
    """Effects of the package: other tests may have added their own."""
    return [effect for effect in catalogue() if type(effect).__module__.startswith("trihedron.")]


def cases_of(effect):
    """(case or None where only the run tells, names of the values) of every sentence that an effect can ask for."""
    for kind in type(effect).__mro__:
        if kind in (Effect, object) or not kind.__module__.startswith("trihedron.diagnose.effects"):
            continue
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(kind)))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "told":
                case = node.args[0].value if isinstance(node.args[0], ast.Constant) else None
                yield case, {keyword.arg for keyword in node.keywords}


def test_every_effect_has_its_words_and_every_word_its_effect():
    assert set(CATALOGUE) == {effect.id for effect in ours()}
    assert len(ENTRIES) == len(CATALOGUE)
    assert all(entry.mechanism and entry.experiment for entry in ENTRIES)


def test_an_effect_asks_for_exactly_the_sentences_and_places_of_the_catalogue():
    asked = 0
    for effect in ours():
        said, seen = dict(CATALOGUE[effect.id].said), set()
        for case, given in cases_of(effect):
            # A case that the run chooses: each that nothing else asks for takes these values.
            for one in [case] if case else set(said) - AT_REST:
                assert places(said[one]) == given, f"{effect.id} '{one}'"
                seen.add(one)
        assert seen == set(said) - AT_REST, effect.id
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


def written(path):
    """(line, text) of every string of a file that is no docstring or refusal; of one with places, the text between."""
    tree = ast.parse(path.read_text())
    skipped = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            skipped.add(id(node.value))
        if isinstance(node, ast.Raise):  # a refusal speaks for itself
            skipped |= {id(part) for part in ast.walk(node)}
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(part) for part in ast.walk(node) if part is not node}
            texts = [part.value for part in node.values if isinstance(part, ast.Constant)]
            yield node.lineno, "".join(texts)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
            yield node.lineno, node.value


@pytest.mark.parametrize("room", ["effects", "rest", "against", "residuals"])
def test_an_effect_writes_no_sentence(room):
    files = sorted((DIAGNOSE / room).glob("*.py"))
    assert files
    prose = [
        f"{path.name}:{line}: {text!r}"
        for path in files
        for line, text in written(path)
        if " " in text.strip() and not NAMES.fullmatch(text.strip())
    ]
    assert prose == []


def test_an_effect_of_the_package_carries_no_words_of_its_own():
    for effect in ours():
        assert effect.mechanism == effect.experiment == "", effect.id


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
    assert own.statement(strongest) == "the readings follow the moon (strongest term m_y: 2 ± 0.1 m/s^2)."
    assert own.separating_experiment() == "wait a fortnight"
    with pytest.raises(KeyError):
        own.told("no such case")


@pytest.mark.parametrize(
    ("effect", "case", "values", "said"),
    [
        ("earth-rate", "latitude",
         {"latitude_deg": -49.6, "latitude_std_deg": 2.04, "azimuth_deg": -12.2, "azimuth_std_deg": 0.31},
         "the gyros see the Earth turn (at its one rate that is a latitude of 50° ± 2°; north lies -12° ± 0.3° from "
         "the first pose's x)."),
        ("lever-arm", "arm", {"arm_m": 0.0816, "share": 0.934},
         "The accelerometers sit 8.2 cm from the centre of rotation: one arm predicts 93 % of the acceleration in "
         "moves it was not fitted to (what hands do most weighs least)."),
        ("gyro-hidden-drift", "walk", {"range": np.radians([0.0123, 0.4, 1.0])},
         "The gyro's zero drifts as a walk, beyond its noise through 0.012, 0.4, 1 °/s (x, y, z); no logged channel "
         "explains it."),
        ("accel-hidden-drift", "slow", {"range": np.array([0.0123, 0.4, 1.0])},
         "The accelerometer's zero drifts slowly through 12, 4e+02, 1e+03 mm/s² (x, y, z); no logged channel explains "
         "it."),
        ("accel-hidden-drift", "at-rest-counts", {"range": np.array([1.234, 40.0, 1000.0])},
         "The accelerometer's zero drifts smoothly through 1.23, 40, 1e+03 counts (x, y, z); no logged channel "
         "explains it. A support that settles does the same across gravity."),
        ("gyro-thermal-bias", "at-rest",
         {"low_degc": -18.4, "high_degc": 73.6, "is_straight": False, "is_parabola": True, "has_rate": True,
          "has_branches": True, "swing": np.radians([0.1, 0.2, 0.34]), "left": np.radians([0.01] * 3),
          "raw": np.radians([0.11] * 3), "has_gap": True, "gap": np.radians([0.5] * 3), "is_one_pose": False},
         "The gyro's zero follows the temperature from -18 to 74 °C by a parabola, and its rate of change, on two "
         "branches: it runs through 0.1, 0.2, 0.34 °/s (x, y, z); 0.01, 0.01, 0.01 °/s rms stay of 0.11, 0.11, 0.11 "
         "°/s. At one temperature heating and cooling differ by 0.5, 0.5, 0.5 °/s: hysteresis, or a drift in time, "
         "which one cycle does not tell."),
        ("accel-thermal-bias", "at-rest",
         {"low_degc": 5.0, "high_degc": 25.0, "is_straight": False, "is_parabola": False, "has_rate": False,
          "has_branches": False, "swing": np.array([0.1234] * 3), "left": np.array([0.01] * 3),
          "raw": np.array([0.11] * 3), "has_gap": False, "gap": (), "is_one_pose": True},
         "The accelerometer's zero follows the temperature from 5 to 25 °C by a curve of third order: it runs through "
         "123, 123, 123 mm/s² (x, y, z); 10, 10, 10 mm/s² rms stay of 110, 110, 110 mm/s². One orientation does not "
         "tell zero from scale, nor the fixture's own tilt across gravity."),
        ("axis-handedness", "reversed",
         {"is_one": True, "is_two": False, "is_three": False, "reversed": ["x"], "kept": ["y", "z"]},
         "The documented axes of accelerometer and gyro do not fit one right-handed triad: reversed is gyro axis x, or "
         "both other gyro axes and that accelerometer axis."),
        ("axis-handedness", "reversed",
         {"is_one": False, "is_two": True, "is_three": False, "reversed": ["x", "z"], "kept": ["y"]},
         "The documented axes of accelerometer and gyro do not fit one right-handed triad: reversed is accelerometer "
         "axis y, or gyro axes x and z."),
        ("axis-handedness", "reversed",
         {"is_one": False, "is_two": False, "is_three": False, "reversed": [], "kept": ["x", "y", "z"]},
         "The documented axes of accelerometer and gyro do not fit one right-handed triad: reversed is the order of "
         "the axes."),
        ("disturbed-pose", "not-still",
         {"is_bumped": True, "bumped_s": [(31.254,), (80.0,)], "is_restless": True, "restless": [3, 7],
          "are_both": True},
         "Not every pose was still (bumped at 31.25 s, 80.00 s; restless: pose 3, 7)."),
        ("disturbed-pose", "not-still",
         {"is_bumped": False, "bumped_s": [], "is_restless": True, "restless": [3], "are_both": False},
         "Not every pose was still (restless: pose 3)."),
        ("disturbed-pose", "pushed", {"pose": 4.0, "off": 0.0123},
         "Pose 4 was not still or was pushed: its mean is off by 0.012 m/s²; repeat or leave it out."),
        ("dropped-samples", "losses", {"losses": [(12, 31.254), (3, 40.0)], "has_more": True, "more": 2},
         "Samples are missing though the time stamps run on: 12 at 31.25 s, 3 at 40.00 s and 2 more."),
        ("quantisation", "steps",
         {"channels": ["gx", "gz"], "is_dead": True, "dead": 2.0, "step": 1.0, "times": 3.0},
         "Readings of gx, gz do not move within 2 raw units of zero: averaging does not resolve between steps."),
        ("quantisation", "steps",
         {"channels": ["gx"], "is_dead": False, "dead": 0.0, "step": 0.0625, "times": 3.14},
         "Readings of gx move in steps of 0.0625 raw units, 3.1 times their noise: averaging does not resolve between "
         "steps."),
        ("turn-angle-error", "turns", {"wrong": 2, "turns": 9, "most_rad": np.radians(3.24), "near_deg": 5.0},
         "2 of 9 table turns miss their multiple of 90° (up to 3.2°, others within 5°)."),
        ("accel-saturation", "plateaus", {"plateaus": 3, "samples": 40, "touched": 2, "moves": 11},
         "The accelerometer reaches the end of its range: 3 plateaus, 40 samples, in 2 of 11 moves; what those moves "
         "read is false and is left out of the fit."),
        ("gyro-hidden-drift", "only-model",
         {"statement": "It drifts.", "has_reason": True, "reason": "the log has no gyro"},
         "Only the model has it: It drifts. Of the recording the log has no gyro, and nothing in it drifts by as "
         "much."),
    ],
)  # fmt: skip
def test_a_sentence_stays_as_it_was_published(effect, case, values, said):
    assert case in OF_ANY or places(CATALOGUE[effect].said[case]) == set(values)
    made = effect_words(effect, case, **values)
    assert made == said
    assert isinstance(made, Words)


def test_a_case_or_a_reason_that_is_not_there_is_refused():
    with pytest.raises(KeyError):
        effect_words("lever-arm", "no such case")
    with pytest.raises(KeyError):
        effect_words("lever-arm", "arm", share=0.5)
    with pytest.raises(KeyError):
        why_not("no such reason")


def test_the_documents_list_the_effects_as_the_catalogue_has_them():
    assert set(re.findall(r"^## (\S+)$", page(), re.MULTILINE)) == {entry.id for entry in ENTRIES}


def test_laws_write_no_sentence_and_their_sentences_have_their_places():
    asked = {}
    for path in sorted((DIAGNOSE / "laws").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "words":
                asked[node.args[0].value] = {keyword.arg for keyword in node.keywords}
        if path.name != "written.py":  # it writes a file of Python
            said = [text for _, text in written(path) if re.search(r"[a-z] (follows|grows|hold|reach) ", text)]
            assert said == [], path.name
    assert {case: set(places(PHRASES[case])) for case in asked} == asked
    assert {case for case in PHRASES if case.startswith("law-")} < set(asked)


def test_every_family_of_a_law_has_an_experiment():
    asked = set()
    for path in (DIAGNOSE / "laws" / "signals.py", DIAGNOSE / "laws" / "moves.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            is_signal = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Signal"
            parts = node.args if is_signal else node.elts if isinstance(node, ast.Tuple) and len(node.elts) == 4 else []
            if parts and isinstance(parts[0], ast.Constant):
                asked.add(parts[0].value)
    assert asked | {"room", "earth"} == set(laws.FAMILIES)
    assert all(one.experiment for one in laws.FAMILIES.values())
    assert laws.family_words("no such family") == laws.FamilyWords("")
