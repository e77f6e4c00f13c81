"""Shared fixtures: the folder of real recordings, where it is present."""

import os
import tempfile
from pathlib import Path

# Two test processes on two cores: linear algebra that starts threads of its own only waits for itself.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Commands that tests start run on compiled Python, as an installation leaves it, and leave none in the sources.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    os.environ.setdefault("PYTHONPYCACHEPREFIX", str(Path(tempfile.gettempdir()) / "trihedron-compiled"))

import pytest

import this_run  # noqa: F401 - before workers start, who inherit its folder
from trihedron.records.words import Words
from trihedron.report.findings import catalogue

REAL_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings; the test is skipped where they are absent."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"real recordings are not on this machine (looked in {REAL_DATA.name} beside the checkout)")
    return REAL_DATA


# Names that stand in the recording or in its file, quoted as they are.
NAMES_OF_THE_RECORDING = {
    "roles", "rest", "column", "line", "example", "name", "path", "where", "file", "taken", "others", "members",
    "kinds", "chosen", "device",
}  # fmt: skip


def _strings(value):
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _strings(one)


@pytest.fixture(autouse=True)
def stages_write_no_words(monkeypatch):
    """A value of a finding that has more than one word is the catalogue's, or a name in the recording."""
    asked = catalogue.words_of

    def words_of(code, case, severity, values):
        for place, value in values.items():
            written = [text for text in _strings(value) if " " in text.strip() and not isinstance(text, Words)]
            assert not written or place in NAMES_OF_THE_RECORDING, f"{code.value} '{case}': {place} = {written}"
        return asked(code, case, severity, values)

    monkeypatch.setattr(catalogue, "words_of", words_of)


@pytest.fixture
def few_simulations(monkeypatch):
    """Improved scenarios are aimed by two simulations and not by eight: enough where their files are what is tested."""
    monkeypatch.setattr("trihedron.api.driving.N_SEEDS", 2)
