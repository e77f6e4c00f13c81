"""A pass over a long log that was stopped goes on from its checkpoint, to the same bits."""

import subprocess
import sys
import zipfile

import numpy as np
import pytest

from test_streaming import COLUMNS, opened, path, whole
from trihedron import _core
from trihedron.api import identifying, streaming
from trihedron.cli import main
from trihedron.files import checkpoint as kept_file
from trihedron.files.checkpoint import Checkpoint

__all__ = ["path", "whole"]


class Stopped(Exception):
    pass


@pytest.fixture(autouse=True)
def keep_after_every_piece(monkeypatch):
    monkeypatch.setattr(kept_file, "EVERY_S", 0.0)
    monkeypatch.setattr(Checkpoint.__init__, "__defaults__", (0.0,))


def stop_after(monkeypatch, times):
    """The pass ends as if killed right after the checkpoint was written for the ``times``-th time."""
    keep, left = Checkpoint.keep, [times]

    def counted(self, rows, state):
        keep(self, rows, state)
        left[0] -= 1
        if not left[0]:
            raise Stopped

    monkeypatch.setattr(Checkpoint, "keep", counted)


def test_the_state_of_another_stream_is_refused():
    stream = _core.AllanStream(1, [1, 2, 100000], _core.AllanStream.LEAST_BUDGET)
    stream.extend(np.arange(300.0)[:, None])
    state = stream.state()
    for other in (
        _core.AllanStream(1, [1, 2, 3], _core.AllanStream.LEAST_BUDGET),
        _core.AllanStream(2, [1, 2, 100000], _core.AllanStream.LEAST_BUDGET),
    ):
        with pytest.raises(ValueError, match="state"):
            other.restore(state)
    numbers, fine, window, sums = state[0]
    own = _core.AllanStream(1, [1, 2, 100000], _core.AllanStream.LEAST_BUDGET)
    for bad in (np.full(6, np.nan), numbers[:5], numbers + np.eye(6)[3], numbers * (1 + 2 * np.eye(6)[4])):
        with pytest.raises(ValueError, match="state"):
            own.restore([(bad, fine, window, sums)])


def test_the_noise_of_a_long_log_goes_on(path, tmp_path, monkeypatch):
    monkeypatch.setattr(identifying, "IN_MEMORY_BYTES", 0)
    monkeypatch.setattr(identifying.open_chunks(path, COLUMNS).__class__.chunks, "__defaults__", (2000, 0))
    kept = tmp_path / "pass"
    wanted = identifying.noise_of_file(path, columns=COLUMNS, rate_hz=100.0)
    with monkeypatch.context() as patch:
        stop_after(patch, 2)
        with pytest.raises(Stopped):
            identifying.noise_of_file(path, columns=COLUMNS, rate_hz=100.0, checkpoint=kept)
    with pytest.raises(ValueError, match="other columns, units or rate"):
        identifying.noise_of_file(path, columns=COLUMNS, rate_hz=200.0, checkpoint=kept)
    found = identifying.noise_of_file(path, columns=COLUMNS, rate_hz=100.0, checkpoint=kept)
    np.testing.assert_array_equal(found.curve.deviation, wanted.curve.deviation)
    assert not kept.exists()


def test_a_file_that_is_no_checkpoint_is_left_alone(path, tmp_path):
    kept = tmp_path / "precious.txt"
    packed = tmp_path / "packed.npz"
    np.savez_compressed(packed, made_of=np.array("x"), rows=np.array(3))
    kept.write_text("years of work")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("a", "b")
    for other in (kept, packed, tmp_path / "other.zip", tmp_path):
        before = other.read_bytes() if other.is_file() else None
        with pytest.raises(ValueError, match="no checkpoint and was left alone"):
            streaming.segment_file(opened(path), checkpoint=other)
        assert before is None or other.read_bytes() == before


def test_the_commands_keep_and_go_on(path, tmp_path, capsys):
    log = [str(path), "--columns", COLUMNS, "--rate", "100"]
    assert main(["segment", *log, "--checkpoint", str(tmp_path / "p")]) == 1
    assert "--checkpoint belongs to --stream" in capsys.readouterr().err
    # Killed in the midst of a pass, then run again: what is printed is what one run prints.
    killed = (
        "import os, sys\nfrom trihedron.files.checkpoint import Checkpoint\nfrom trihedron.api import streaming\n"
        "from trihedron.cli import main\nstreaming.PIECE_ROWS = 700\nkeep = Checkpoint.keep\n"
        "def once(self, rows, state):\n    self.every_s = 0.0\n    keep(self, rows, state)\n    os._exit(9)\n"
        "Checkpoint.keep = once\nmain(sys.argv[1:])\n"
    )
    kept = tmp_path / "pass"
    said = ["segment", *log, "--stream", "--checkpoint", str(kept)]
    done = subprocess.run([sys.executable, "-c", killed, *said], capture_output=True)
    assert done.returncode == 9
    assert kept.exists()
    status = main(said)
    with_it = capsys.readouterr().out
    assert not kept.exists()
    assert main(said[:-2]) == status
    assert capsys.readouterr().out == with_it
