"""The Rust tests run as part of `pytest`."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_cargo_test_passes():
    if shutil.which("cargo") is None:
        pytest.skip("no Rust toolchain on this machine: the kernels were compiled elsewhere")
    done = subprocess.run(["cargo", "test", "--quiet"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
