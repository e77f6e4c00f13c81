"""Shared fixtures: the folder of real recordings, where it is present."""

from pathlib import Path

import pytest

REAL_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings; the test is skipped where they are absent."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"real recordings are not on this machine (looked in {REAL_DATA.name} beside the checkout)")
    return REAL_DATA
