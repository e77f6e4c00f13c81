"""Shared fixtures: the folder of real recordings, where it is present."""

import os
from pathlib import Path

# Two test processes on two cores: linear algebra that starts threads of its own only waits for itself.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

REAL_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings; the test is skipped where they are absent."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"real recordings are not on this machine (looked in {REAL_DATA.name} beside the checkout)")
    return REAL_DATA
