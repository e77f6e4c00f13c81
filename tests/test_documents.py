"""The documents: every page is in the navigation, every link holds, and the site shows what the sources say."""

import os
import re
import subprocess
import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
import yaml

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

import trihedron

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PACKAGE = ROOT / "python" / "trihedron"
ROOTS = [ROOT, PACKAGE, ROOT / "rust", ROOT / "python", PACKAGE / "diagnose", DOCS]
PAGES = sorted(DOCS.rglob("*.md"))
# Made from the code when the site is built (docs/hooks/reference.py), or from a notebook beside it.
MADE = {f"reference/{name}.md" for name in ("commands", "python", "findings", "effects", "schemas")}
MADE |= {"tutorials/notebook.md"}
# What a fence may say behind its backticks: a language, and nothing else.
FENCE = re.compile(r"^ *```(.*)$", re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def navigated(part):
    """Paths of a navigation, however deep."""
    if isinstance(part, str):
        return [part]
    return [path for inner in (part.values() if isinstance(part, dict) else part) for path in navigated(inner)]


def test_every_page_is_in_the_navigation_once():
    listed = navigated(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    assert len(listed) == len(set(listed))
    assert set(listed) == {page.relative_to(DOCS).as_posix() for page in PAGES} | MADE


@pytest.mark.parametrize("page", [*PAGES, *ROOT.glob("*.md")], ids=lambda page: page.stem)
def test_links_of_the_sources_hold_fences_say_their_language_and_files_that_they_name_are_there(page):
    text = page.read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```|`[^`\n]+`", "", text, flags=re.MULTILINE | re.DOTALL)
    paths = {link.partition("#")[0] for link in LINK.findall(prose) if not re.match(r"\w+:", link)} - {""}
    places = {path: (page.parent / path).resolve() for path in paths}
    made = {DOCS / name for name in MADE}
    assert [path for path, place in places.items() if not place.exists() and place not in made] == []
    # What a figure was made with can be run again.
    named = set(re.findall(r"(?<=python )benches/\w+(?:\.py)?|\b(?:benches|tests)/[\w/]+\.py\b", text))
    # Paths with a file's ending, looked for where a reader would look.
    named |= set(re.findall(r"`([\w./-]+/[\w.-]+\.(?:py|pyi|rs|md|schema\.json))`", text))
    assert [name for name in named if not any((root / name).exists() for root in ROOTS)] == []
    said = FENCE.findall(text) if page in PAGES else []
    assert not [words for words in said if not re.fullmatch(r"\w*", words)]
    assert len(said) % 2 == 0


def test_the_readme_is_short_and_its_pictures_are_in_the_repository():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 140
    pictures = re.findall(r"!\[[^]]*\]\((\S+)\)", text)
    assert pictures
    assert all((ROOT / picture).is_file() for picture in pictures)
    evidence = text.partition("## Evidence")[2].partition("\n## ")[0]
    assert 3 < len(re.findall(r"^\|", evidence, re.MULTILINE)) <= 2 + 12


def test_on_a_package_index_every_link_of_the_readme_is_absolute_and_the_package_has_urls():
    spec = spec_from_file_location("index_readme", ROOT / ".ci/index_readme.py")
    made = module_from_spec(spec)
    spec.loader.exec_module(made)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    page = made.absolute(text, "https://host.example/owner/trihedron", "v0.1.0")
    links = LINK.findall(page)
    assert len(links) == len(LINK.findall(text))
    assert all(link.startswith("https://host.example/owner/trihedron/") for link in links)
    assert "](https://host.example/owner/trihedron/raw/v0.1.0/docs/figures/page_calibrate.png)" in page
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8") + made.urls("https://host.example/o/t", "v1"))
    assert set(project["project"]["urls"]) == {"Source", "Documentation", "Changelog"}
    assert "name" in project["project"]


def test_what_a_release_says_of_itself_agrees():
    version = re.search(r'^version = "(.*)"$', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.MULTILINE)[1]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert citation["version"] == version
    assert f"## {version} ({citation['date-released']})" in changes
    assert len(changes.splitlines()) <= 40


@pytest.mark.slow
def test_nothing_of_the_site_is_loaded_from_elsewhere(tmp_path):
    """The site as it is published."""
    needed = ("mkdocs", "material", "mkdocstrings", "mkdocs_gen_files", "latex2mathml")
    missing = [name for name in needed if not find_spec(name)]
    if missing:
        pytest.skip(f"the site cannot be built without {', '.join(missing)} (extra docs)")
    quiet = {"NO_MKDOCS_2_WARNING": "1", "DISABLE_MKDOCS_2_WARNING": "true"}
    quiet |= {"PYTHONPATH": str(Path(trihedron.__file__).parents[1])}
    # Without -q, which silences the warnings before --strict counts them.
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(tmp_path)]
    built = subprocess.run(
        command, cwd=ROOT, env={**os.environ, **quiet}, capture_output=True, text=True, timeout=600, check=False
    )
    assert built.returncode == 0, built.stdout + built.stderr
    elsewhere = re.compile(r"""(?:src|href)="(?:https?:)?//[^"]+\.(?:js|css|woff2?)\"""")
    assert not [page for page in tmp_path.rglob("*.html") if elsewhere.search(page.read_text(encoding="utf-8"))]
