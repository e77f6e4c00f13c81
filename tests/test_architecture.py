"""The layout's rules, held by the machine."""

import ast
import gc
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "python" / "trihedron"
STAGES = ("read", "segment", "estimate", "diagnose", "simulate", "report", "capture")
# What any stage may import: the nouns, the model, units. `_core` only where numbers are made.
# A fleet is `api` over many logs.
COMPOSERS = {"api", "comparison", "cli", "fleet", "__init__", "__main__"}
# What a record is built on: names of arrays, units and errors, and the place where it asks what others make.
BELOW_RECORDS = {"answers", "arrays", "errors", "sanitise", "units"}
# Where numbers are made.
MAY_USE_CORE = {"read", "segment", "estimate", "diagnose", "simulate", "session", "channel_facts"} | {
    "arrays.py",
    "probability.py",
    "quantiles.py",
    "errors.py",
}
LONGEST_FILE, LONGEST_FUNCTION = 350, 79
# One model whose files still take each other's types.
ONE_PIECE = {"session_model"}
# Names that others call by: typer, http.server, notebooks, the catalogue that gathers effects by their base class.
CALLED_BY_NAME = re.compile(r"^(__\w+__|do_GET|do_POST|log_message|handle_error|_repr_\w+_)$")
# Ours, with a letter before the point where a page numbers its own; a number of three parts is another book's.
NUMBER = r"(?:\d+|[A-Z])\.\d+[a-z]?(?!\.?\d)"
CITED = re.compile(rf"\b(?:eqs?|equations?)\.? ?\(?({NUMBER}(?:(?:-|, | to | and ){NUMBER})*)", re.IGNORECASE)
# At the head of an indented line, at its end, or before a paragraph that is the statement in words.
STATED = [
    re.compile(rf"^    \(({NUMBER})\) ", re.MULTILINE),
    re.compile(rf"^    .*\s\(({NUMBER})\)$", re.MULTILINE),
    re.compile(rf"\\tag\{{({NUMBER})\}}"),
    re.compile(rf"^\(({NUMBER})\) [A-Z]", re.MULTILINE),
]


@pytest.fixture(scope="module", autouse=True)
def no_search_for_garbage():
    """Which every million nodes of the package's files would start, and find none."""
    gc.disable()
    yield
    gc.enable()


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Every node of a file of Python, read once for all rules. No rule changes any."""
    return list(ast.walk(ast.parse(path.read_text())))


@cache
def imported_modules(path: Path) -> set[str]:
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_a_stage_imports_no_other_stage_and_nobody_who_composes_it():
    for path in PACKAGE.rglob("*.py"):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if own not in COMPOSERS:
            parts = {m.split(".")[1] for m in imported_modules(path) if m.startswith("trihedron.")}
            foreign = parts & ({*STAGES, *COMPOSERS} - {own})
            assert not foreign, f"{path.name} belongs to {own} and imports {sorted(foreign)}"


def test_records_import_nobody():
    for path in (PACKAGE / "records").rglob("*.py"):
        parts = {m.split(".")[1] for m in imported_modules(path) if m.startswith("trihedron.")} - {"records"}
        assert parts <= BELOW_RECORDS, f"{path.name} imports {sorted(parts - BELOW_RECORDS)}"
        assert "import_module" not in path.read_text(), path


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Sets of files that reach one another."""
    reached = {name: set() for name in arrows}
    for start, seen in reached.items():
        left = [start]
        while left:
            new = (arrows[left.pop()] & arrows.keys()) - seen
            seen |= new
            left += new
    return sorted({tuple(sorted(b for b in reached[a] if a in reached[b])) for a in arrows if a in reached[a]})


def test_no_module_imports_itself_by_way_of_others():
    """Imports inside functions count as well; those for types alone do not."""
    names = {}
    for path in PACKAGE.rglob("*.py"):
        names[".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")] = path
    arrows = {}
    for name, path in names.items():
        types = [n for n in nodes(path) if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.unparse(n.test)]
        unseen = {id(inner) for one in types for part in one.body for inner in ast.walk(part)}
        found = set()
        for node in nodes(path):
            if isinstance(node, ast.ImportFrom) and node.module and id(node) not in unseen:
                whole = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= {one if one in names else node.module for one in whole}
        arrows[name] = found - {name}
    assert circles(arrows) == []


def code_of(path: Path) -> str:
    """A file of Rust without its comments."""
    return re.sub(r"//.*", "", path.read_text())


def test_no_module_of_the_core_uses_itself_by_way_of_others():
    rust = ROOT / "rust"
    crate = {path.relative_to(rust).parts[0].removesuffix(".rs") for path in rust.rglob("*.rs")} - {"lib"}
    arrows = {name: set() for name in crate}
    for path in rust.rglob("*.rs"):
        own = path.relative_to(rust).parts[0].removesuffix(".rs")
        if own in crate:
            arrows[own] |= set(re.findall(r"\bcrate::(?:\{\s*)?(\w+)", code_of(path))) & crate - {own}
    assert circles(arrows) == []
    for folder in {path.parent for path in rust.rglob("*.rs")} - {rust, *(rust / name for name in ONE_PIECE)}:
        own = {path.stem for path in folder.glob("*.rs")} - {"mod"}
        used = {n: set(re.findall(r"\bsuper::(\w+)", code_of(folder / f"{n}.rs"))) & own - {n} for n in own}
        assert circles(used) == [], folder


def test_only_the_seam_names_pyo3_or_numpy():
    for path in (ROOT / "rust").rglob("*.rs"):
        if "python" in path.relative_to(ROOT / "rust").parts[0]:
            continue
        assert not re.search(r"\b(pyo3|numpy)::", path.read_text()), path


def test_only_the_report_room_draws():
    """Types of what it draws may be named elsewhere: such an import never runs."""
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).parts[0] != "report":
            runs = re.sub(r"^if TYPE_CHECKING:\n(?: .*\n|\n)*", "", path.read_text(), flags=re.MULTILINE)
            assert not re.search(r"^\s*(?:import|from) matplotlib\b", runs, re.MULTILINE), path


def test_the_top_level_is_the_agreed_one():
    allowed = {"Cargo.toml", "Cargo.lock", "pyproject.toml", "rust", "python", "tests", "benches", "README.md"}
    allowed |= {"LICENSE", "CHANGELOG.md", "docs"}
    # Looked for at the top by name: by people and GitHub, by reference managers, by mkdocs.
    allowed |= {"CONTRIBUTING.md", "CITATION.cff", "mkdocs.yml"}
    untracked = {"target", "dist"}
    found = {p.name for p in ROOT.iterdir() if not p.name.startswith((".", "trihedron-demo"))} - untracked
    assert found <= allowed, found - allowed


def test_only_the_rooms_that_make_numbers_use_the_core():
    users = {
        path.relative_to(PACKAGE)
        for path in PACKAGE.rglob("*.py")
        if any(m.split(".")[:2] == ["trihedron", "_core"] for m in imported_modules(path))
    }
    used = {room for room in MAY_USE_CORE for path in users if path.parts[0] == room or str(path) == room}
    assert all(path.parts[0] in MAY_USE_CORE or str(path) in MAY_USE_CORE for path in users), users
    assert used == MAY_USE_CORE, f"no longer needed: {MAY_USE_CORE - used}"


def test_no_file_outgrows_its_reader():
    sources = [*PACKAGE.rglob("*.py"), *(ROOT / "rust").rglob("*.rs")]
    assert not {str(p.relative_to(ROOT)) for p in sources if len(p.read_text().splitlines()) > LONGEST_FILE}


def test_no_function_outgrows_its_reader():
    for path in PACKAGE.rglob("*.py"):
        for node in nodes(path):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[0]
                # What it says of itself is no part of what has to be held in one head.
                said = ast.get_docstring(node) is not None and first.end_lineno - first.lineno + 1
                assert node.end_lineno - node.lineno + 1 - said <= LONGEST_FUNCTION, f"{path.name}:{node.name}"


def test_everything_that_is_named_is_used():
    package = list(PACKAGE.rglob("*.py"))
    beside = [
        *PACKAGE.rglob("*.j2"),
        *(ROOT / "tests").rglob("*.py"),
        *(ROOT / "benches").rglob("*.py"),
        *(ROOT / "docs").rglob("*.md"),
    ]
    used = Counter(re.findall(r"\w+", "\n".join(path.read_text() for path in [*package, *beside])))
    unused = set()
    for path in package:
        if path.relative_to(PACKAGE).parts[:2] == ("diagnose", "effects"):
            continue
        named = [n.name for n in nodes(path) if isinstance(n, ast.FunctionDef | ast.ClassDef)]
        top = nodes(path)[0].body
        named += [t.id for n in top if isinstance(n, ast.Assign) for t in n.targets if isinstance(t, ast.Name)]
        unused |= {f"{path.name}:{name}" for name in named if used[name] < 2 and not CALLED_BY_NAME.match(name)}
    assert unused == set()


def test_equations_that_the_code_cites_are_in_the_documents():
    documents = [p.read_text() for p in (ROOT / "docs").glob("*.md")]
    known = {number for text in documents for one in STATED for number in one.findall(text)}
    cited = 0
    for path in [*PACKAGE.rglob("*.py"), *(ROOT / "rust").rglob("*.rs")]:
        numbers = {number for some in CITED.findall(path.read_text()) for number in re.findall(NUMBER, some)}
        cited += len(numbers)
        assert numbers <= known, f"{path.relative_to(ROOT)} cites {sorted(numbers - known)}"
    assert cited > 40


# Records that only stages make: what does not fit together there is a defect, to be seen with its trace.
DEFECTS = {
    "records/calibration.py",
    "records/segments.py",
    "report/findings/wording.py",
    "cli/allan.py",  # caught one line below
}


def raised(path):
    """Names of what a file raises by calling it."""
    for node in nodes(path):
        if isinstance(node, ast.Raise) and node.exc is not None:
            called = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            yield called.id if isinstance(called, ast.Name) else ast.unparse(called)


def test_a_refusal_is_told_from_a_defect():
    plain = {str(p.relative_to(PACKAGE)) for p in PACKAGE.rglob("*.py") if "ValueError" in set(raised(p))}
    assert plain == DEFECTS
    errors = [
        (f"{path.name}: {node.name}", {ast.unparse(base) for base in node.bases})
        for path in PACKAGE.rglob("*.py")
        for node in nodes(path)
        if isinstance(node, ast.ClassDef)
    ]
    # A wrong type is a TypeError first.
    assert [name for name, bases in errors if "ValueError" in bases] == ["checked.py: WrongTypeError"]


# Calls that a handler of ValueError may stand round.
CONVERSIONS = {
    "api/naming_columns.py: float",
    "api/reading_arrays.py: np.ma.asanyarray",
    "fleet/running.py: json.loads",
    "fleet/running.py: path.read_text",
    "fleet/running.py: distributed.Client",
    "fleet/logs.py: os.stat",
}


def test_no_handler_takes_a_defect_of_a_whole_fit_for_a_refusal():
    """Where readings become numbers, ValueError is caught only round a conversion of one value or one note."""
    found = set()
    for room in ("estimate", "diagnose", "segment", "session", "channel_facts", "api", "fleet"):
        for path in (PACKAGE / room).rglob("*.py"):
            for node in nodes(path):
                caught = [h.type for h in node.handlers if h.type is not None] if isinstance(node, ast.Try) else []
                if "ValueError" in {n.id for kind in caught for n in ast.walk(kind) if isinstance(n, ast.Name)}:
                    calls = [n.func for part in node.body for n in ast.walk(part) if isinstance(n, ast.Call)]
                    found |= {f"{path.relative_to(PACKAGE)}: {ast.unparse(called)}" for called in calls}
    assert found == CONVERSIONS
