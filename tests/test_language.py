"""Retired words, held against everything that a user can read: help, reports, schemas, documents, public names.

One word for one thing, the field's own: bias, pose, timestamp, uncertainty, resolution, range limit, X Y Z.
"""

import ast
import dataclasses
import inspect
import json
import re
from collections.abc import Iterator

import pytest
import typer

import trihedron
from test_architecture import PACKAGE, ROOT, no_search_for_garbage, nodes  # noqa: F401
from trihedron.cli import COMMANDS, build_app
from trihedron.report.effects.catalogue import CATALOGUE as EFFECTS
from trihedron.report.findings.catalogue import ENTRIES

RETIRED = {
    # Only where zero means a bias: as a number it stays.
    r"\bzero[- ]readings?": "bias",
    r"\bzero[- ]scatter|\bzeros? (that )?(scatters?|wanders?|strays?|drifts?|walks?|differs?|jumps?|moved)\b": "bias",
    r"\b(gyro|gyroscope|accelerometer|sensor)s?(['’]s?)? zeros?\b": "bias",
    r"\b(one|its|their|whose|a) zeros? (per|for|of|is|are|from)\b": "bias",
    r"\bzeros (and|are)\b|\w['’]s zeros?\b|\bzero (from (rest|poses)|turns?|scatter)\b": "bias",
    r"\bhidden[- ]drift|\bwander(s|ing|ed)?\b": "bias drift",
    # Only the noun: a log holds readings, and a hand holds still.
    r"\b(in|of|hold|from|to|before|after) hold \d": "pose",
    r"\b(each|every|between|inside|per|neighbouring|\d+) holds?\b(?! (the|a|still|up)\b)": "pose",
    r"\bstill (poses?|stretch(es)?)\b|\bhold [ij]\b|\b(knocked|no) hold\b": "pose",
    r"\bgravity at rest\b": "gravity error in static poses",
    # A figure may have error bars.
    r"\berror bars?\b(?![:)])": "uncertainty",
    r"\btime[- ]stamps?\b|(?<![\w_-])stamps?\b(?!_)|\bstamped\b": "timestamp",
    r"\bconverters?\b": "resolution (LSB), ADC",
    r"\bends? of (its|the|their|a) range\b|\bcut peaks\b|\bcrowded ends?\b|\bmet its limit\b": "range limit, clipping",
    r"\bhalf[- ]power\b": "-3 dB bandwidth",
    r"\bcreeps? (of|in) a (hold|pose)\b|\b(hold|pose)s? creeps?\b": "settling",
    r"\b(bumped|pushed) poses?\b|\bposes? (was|were) (bumped|pushed)\b": "disturbed pose",
    r"(?<!power )(?<!power-)\blaws?\b": "empirical relation",
    r"(?<!digital )(?<!trihedron\.)\btwins?\b": "session state; digital twin of simulate",
    r"\b[afw]['′]\d|\b[af]\d =|\bS[123][123]\b|(?<!its )\bax[ei]s [123]\b|\bpoints? half (up|down)\b": "X, Y, Z, S_xx",
    r"\binstrument trihedron\b": "body frame",
    r"\bstill (detection|intervals?)\b|\b(from|to) rest\b|\bresting\b": "static",
    r"\bcolou?ring\b|\bcolou?r(s|ed) (noise|the noise|them|readings)\b": "low-pass filtered",
    r"\bbias(es)?( that)? scatters?\b|\bscatter of (the |an )?\w*['’]?s? ?bias(es)?\b": "bias repeatability",
    r"\bheld-out\b": "cross-validated",
    r"\bbump(s|ed)?\b|\bpushed\b|\bknock(s|ed)?\b": "disturbed",
    r"\bwalking bias(es)?\b|\bbias(es)?( that)? walks?\b": "bias random walk",
    r"(?-i:\b(gyro|accelerometer|about|along|axis|axes) [xyz]\b(?![\w'′_^])|(?<!w, )\bx, y,? (and )?z\b)": "X, Y, Z",
}
CHANNELS = re.compile(r"((tow|time|gyro|accelerometer|accel|acc)( [xyz])?( \[[^\]]+\])?,?)+")
Said = Iterator[tuple[str, str]]
"""Texts, each with where it stands."""
RETIRED_IN_NAMES = re.compile(
    r"(?<![a-z])(zeros?|holds?|bars|stamps?|laws?|creeps?|scatter|converters?|hidden|wander|rest)(?![a-z])"
)


def retired(text: str, words: dict[str, str] = RETIRED) -> list[str]:
    """Each retired word in a text, in its surroundings, with the word to write instead."""
    return [
        f"...{text[max(found.start() - 40, 0) : found.end() + 20]}... -> {word}"
        for pattern, word in words.items()
        for found in re.finditer(pattern, text, re.IGNORECASE)
    ]


def helps() -> Said:
    group = typer.main.get_command(build_app())
    for name in ("", *(command.__name__.replace("_", "-") for command in COMMANDS)):
        command = group.commands[name] if name else group  # type: ignore[attr-defined]
        words = command.get_help(typer.Context(command, info_name=f"trihedron {name}".strip()))
        yield name, re.sub(r"\s+", " ", words)


def modules() -> Said:
    """Texts of two words and more and headings, docstrings apart: all that reports, errors and exported files say."""
    yield from ((path.name, re.sub(r"<[^>]*>", " ", path.read_text("utf-8"))) for path in PACKAGE.rglob("*.j2"))
    for path in PACKAGE.rglob("*.py"):
        inside = {id(part) for node in nodes(path) if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in nodes(path):
            body = getattr(node, "body", None)
            inside |= {id(one.value) for one in (body if isinstance(body, list) else ()) if isinstance(one, ast.Expr)}
        for node in nodes(path):
            if isinstance(node, ast.JoinedStr):
                text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{" for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
                text = node.value
            else:
                continue
            # A label of a random stream keeps its letters, or every seed would draw another series; verbs are bare.
            # Channels have names as in the records: "gyro x".
            is_verbs = set(text.split()) <= set(trihedron.__all__)
            is_said = " " in text.strip() or text[:1].isupper()
            if is_said and not text.startswith("{/") and not is_verbs and not CHANNELS.fullmatch(text):
                yield str(path.relative_to(PACKAGE)), text


def schemas() -> Said:
    def walk(node: object) -> Iterator[str]:
        if isinstance(node, dict):
            yield from (str(node[key]) for key in ("title", "description") if isinstance(node.get(key), str))
            yield from (key.replace("_", " ") for key in node.get("properties", {}))
        for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
            yield from walk(child)

    for path in (PACKAGE / "files/schema").glob("*.json"):
        yield from ((path.name, text) for text in walk(json.loads(path.read_text(encoding="utf-8"))))


def pages() -> Said:
    """Prose without fences, code and addresses; equations with the words between them stay."""
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")):
        name = str(page.relative_to(ROOT))
        text = re.sub(r"^ *```.*?^ *```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        text = re.sub(r"^ +(trihedron|from|import) .*$", "", text, flags=re.MULTILINE)
        text = re.sub(r"`[^`\n]*`|\]\([^)]*\)|\$[^$\n]*\$", "", text)
        yield name, text
    for page in (ROOT / "docs").rglob("*.ipynb"):
        cells = json.loads(page.read_text(encoding="utf-8"))["cells"]
        said = "\n".join("".join(cell["source"]) for cell in cells)
        yield str(page.relative_to(ROOT)), re.sub(r"`[^`\n]*`", "", said)
    # What stands on an index and above a site.
    for name in ("pyproject.toml", "Cargo.toml", "mkdocs.yml", "CITATION.cff"):
        text = (ROOT / name).read_text(encoding="utf-8")
        said = re.findall(r"^(?:site_)?(?:description|title|message)\s*[=:]\s*(.+)$", text, re.MULTILINE)
        yield name, "\n".join(said)


def without_code(text: str) -> str:
    """A docstring or comment without names in backticks and lines of examples."""
    return re.sub(r"``[^`]*``|`[^`]*`|^ *(>>>|\.\.\.).*$", "", text, flags=re.MULTILINE)


def docstrings() -> Said:
    """Of every public name, and of what a public class shows."""
    for name in filter(str.isidentifier, trihedron.__all__):
        public = getattr(trihedron, name)
        yield name, without_code(inspect.getdoc(public) or "")
        for one, member in inspect.getmembers(public) if inspect.isclass(public) else ():
            if not one.startswith("_"):
                yield f"{name}.{one}", without_code(inspect.getdoc(member) or "")


@pytest.mark.parametrize("source", [helps, modules, schemas, pages, docstrings])
def test_nothing_that_a_user_reads_uses_a_retired_word(source):
    said = list(source())
    # All at once is ten times as quick; one after the other says where.
    if retired("\n\n".join(text for _, text in said)):
        assert [(where, found) for where, text in said for found in retired(text)] == []


def test_no_public_name_and_no_key_of_a_file_is_a_retired_word():
    names = {*(entry.code for entry in ENTRIES), *EFFECTS}
    for path in (PACKAGE / "files/schema").glob("*.json"):
        names |= set(re.findall(r'"(\w+)":', path.read_text(encoding="utf-8")))
    for name in filter(str.isidentifier, trihedron.__all__):
        public = getattr(trihedron, name)
        names.add(name)
        if inspect.isclass(public):
            fields = dataclasses.fields(public) if dataclasses.is_dataclass(public) else ()
            names |= {one for one in {*dir(public), *(f.name for f in fields)} if not one.startswith("_")}
        elif callable(public):
            names |= set(inspect.signature(public).parameters)
    assert {name for name in names if RETIRED_IN_NAMES.search(name)} == set()
