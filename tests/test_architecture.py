"""The layout's rules, held by the machine."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "python" / "trihedron"
STAGES = ("read", "segment", "estimate", "diagnose", "simulate", "report", "capture")
# What any stage may import: the nouns, the model, units. `_core` only where numbers are made.
# A fleet is the pipeline over many logs.
COMPOSERS = {"pipeline", "cli", "fleet", "__init__"}


def imported_modules(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def stage_of(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[0] == "trihedron" and parts[1] in STAGES else None


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_stage_imports_no_other_stage(path):
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own in COMPOSERS or own.startswith("cli"):
        return
    foreign = {stage_of(module) for module in imported_modules(path)} - {None, own}
    assert not foreign, f"{path.name} belongs to {own} and imports {sorted(foreign)}"


def test_only_the_seam_names_pyo3_or_numpy():
    for path in (ROOT / "rust").rglob("*.rs"):
        if "python" in path.relative_to(ROOT / "rust").parts[0]:
            continue
        assert not re.search(r"\b(pyo3|numpy)::", path.read_text()), path


def test_only_the_report_room_draws():
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).parts[0] != "report":
            assert not any(m.split(".")[0] == "matplotlib" for m in imported_modules(path)), path


def test_the_top_level_is_the_agreed_one():
    allowed = {"Cargo.toml", "Cargo.lock", "pyproject.toml", "rust", "python", "tests", "benches", "README.md"}
    allowed |= {"LICENSE", "CHANGELOG.md", "docs"}
    # Looked for at the top by name: by people and GitHub, by reference managers, by mkdocs.
    allowed |= {"CONTRIBUTING.md", "CITATION.cff", "mkdocs.yml"}
    untracked = {"target", "dist"}
    found = {p.name for p in ROOT.iterdir() if not p.name.startswith((".", "trihedron-demo"))} - untracked
    assert found <= allowed, found - allowed


def test_nothing_is_called_utils():
    for path in [*PACKAGE.rglob("*"), *(ROOT / "rust").rglob("*")]:
        assert path.stem not in {"utils", "helpers", "common", "misc"}, path
