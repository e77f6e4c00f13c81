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

REAL_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings; the test is skipped where they are absent."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"real recordings are not on this machine (looked in {REAL_DATA.name} beside the checkout)")
    return REAL_DATA


@pytest.fixture
def few_simulations(monkeypatch):
    """Improved scenarios are aimed by two simulations and not by eight: enough where their files are what is tested."""
    monkeypatch.setattr("trihedron.comparison.driving.N_SEEDS", 2)


@pytest.fixture(scope="module")
def without_corners():
    """Corners of filters cost nine tenths of a spectrum's time; tests/test_channel_facts.py has them."""
    from trihedron.records.channel_facts import LowPass

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("trihedron.estimate.noise.poses.low_passes", lambda s, _: [LowPass(None, 100.0)] * len(s))
        patch.setattr("trihedron.channel_facts.static_axes.undisturbed", lambda spectrum, _: spectrum)
        yield
