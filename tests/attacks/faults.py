"""Faults while outputs are written: killed at any instant, a disk that fills up, a device that is full, a slow pipe."""

from __future__ import annotations

import contextlib
import io
import os
import re
import resource
import select
import shutil
import signal
import time
from pathlib import Path

from attacks.cases import LONGEST_WORK_S, Attack
from small_session import G
from trihedron.cli import main

WAIT_S = 120.0
OLD = b"what stood here before\n"
OF_ITS_DAY = re.compile(rb'"(made_at|created|started)": "[^"]*"|\d{4}-\d\d-\d\d \d\d:\d\d UTC')
LINES: dict[str, list[str]] = {
    "check": ["check", "log.csv", "--json", "OUT.json", "--report", "OUT.html"],
    "segment": ["segment", "log.csv", "--json", "OUT.json", "--report", "OUT.html"],
    "calibrate": ["calibrate", "log.csv", "--gravity", G, "-o", "OUT.json", "--json", "OUT2.json"],
    "calibrate, report": ["calibrate", "log.csv", "--gravity", G, "--report", "OUT.html"],
    "allan": ["allan", "rest.csv", "--json", "OUT.json", "--csv", "OUT.csv", "--report", "OUT.html"],
    "kalman": ["kalman", "log.csv", "--gravity", G, "-o", "OUT.json", "--report", "OUT.html"],
    "verify": ["verify", "c.json", "log.csv", "--json", "OUT.json", "--report", "OUT.html"],
    "diagnose": ["diagnose", "log.csv", "--gravity", G, "--json", "OUT.json", "--report", "OUT.html"],
    "apply": ["apply", "c.json", "log.csv", "-o", "OUT.csv", "--json", "OUT.json"],
    "apply, parquet": ["apply", "c.json", "log.csv", "-o", "OUT.parquet"],
    "apply, in pieces": [
        *("apply", "c.json", "six.npy", "-o", "OUT.npy", "--stream", "--columns", "ax,ay,az,gx,gy,gz"),
        *("--rate", "100"),
    ],
    "convert": ["convert", "log.csv", "-o", "OUT.csv"],
    "convert, npz": ["convert", "log.csv", "-o", "OUT.npz"],
    "export": ["export", "c.json", "--to", "c", "-o", "OUT.h"],
    "export, noise": ["export", "c.json", "--noise", "noise.json", "--to", "python", "-o", "OUT.py"],
    "simulate": ["simulate", "s.toml", "-o", "OUT.csv", "--truth", "OUT.json"],
    "guide": ["guide", "log.csv", "-o", "OUT.json"],
    "plan": ["plan", "--json", "OUT.json"],
}
"""One line per way of writing. `capture` is killed by `benches/capture.py kill`, `fleet` in tests/test_fleet.py."""


class Faults(Attack):
    """Every way of writing under every fault; the outputs are the old ones or the new ones, and whole."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.names = list(LINES)
        self.whole: dict[str, tuple[float, dict[str, bytes]]] = {}

    def _case(self, number: int) -> tuple[str, str]:
        kind = ("kill", "kill", "kill", "limit", "full", "pipe")[number % 6]
        return self.names[(number // 6) % len(self.names)], kind

    def longest_s(self, _number: int) -> int:
        return LONGEST_WORK_S

    def describe(self, number: int) -> str:
        return ", ".join(self._case(number))

    def run(self, number: int) -> str:
        name, kind = self._case(number)
        folder = self.folder / f"faults-{os.getpid()}"
        if not folder.exists():
            folder.mkdir()
            for file, data in self.files.items():
                (folder / file).write_bytes(data)
            _six(folder / "six.npy", self.files["log.npy"])
        if name not in self.whole:
            self._emptied(folder)
            began = time.monotonic()
            status, err = self._ran(folder, [*LINES[name], "--force"])
            if status not in (0, 2):
                return f"FAILED: undisturbed: status {status}: {err!r}"
            self.whole[name] = (time.monotonic() - began, self._outputs(folder, name))
        return getattr(self, f"_{kind}")(folder, name, number)

    # Faults

    def _kill(self, folder: Path, name: str, number: int) -> str:
        rng = self.rng(number)
        took, whole = self.whole[name]
        self._emptied(folder)
        had_old = rng.random() < 0.5
        if had_old:
            for file in whole:
                (folder / file).write_bytes(OLD)
        # Half of the kills in the last part, where outputs are written.
        after = took * (rng.random() if rng.random() < 0.5 else 0.7 + 0.6 * rng.random())
        child = self._started(folder, [*LINES[name], "--force"])
        time.sleep(after)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        states = set()
        for file, data in whole.items():
            found = (folder / file).read_bytes() if (folder / file).exists() else None
            states.add("new" if found is not None and _same(found, data) else "old")
            if found is not None and not _same(found, data) and not (had_old and found == OLD):
                return f"FAILED: killed after {after:.3f} s, {file} is neither old nor new: {len(found)} bytes"
        status, err = self._ran(folder, [*LINES[name], "--force"])
        if status not in (0, 2):
            return f"FAILED: the next run: status {status}: {err!r}"
        return self._judged(folder, name, f"killed, {' and '.join(sorted(states))}")

    def _limit(self, folder: Path, name: str, number: int) -> str:
        _, whole = self.whole[name]
        self._emptied(folder)
        for file in whole:
            (folder / file).write_bytes(OLD)
        smallest = max(min(len(data) for data in whole.values()) - 1, 1)
        limit = int(self.rng(number).integers(0, smallest))
        status, err = self._ran(folder, [*LINES[name], "--force"], limit)
        if status != 1 or "File too large" not in err or len(err.strip().splitlines()) > 1:
            return f"FAILED: room for {limit} bytes: status {status}: {err[-300:]!r}"
        if any((folder / file).read_bytes() != OLD for file in whole):
            return f"FAILED: room for {limit} bytes: an old output was harmed"
        left = _left(folder)
        return f"FAILED: {left} left" if left and name != "apply, in pieces" else "disk full, refused"

    def _full(self, folder: Path, name: str, _number: int) -> str:
        if "in pieces" in name or any(word in name for word in ("parquet", "npz")):
            return "not of a device"
        words = [re.sub(r"^OUT(?!2)[.\w]*$", "/dev/full", word) for word in LINES[name]]
        if "--report" in words or words.count("/dev/full") > 1:
            words = [*LINES[name][:2], "--json", "/dev/full"] if "--json" in LINES[name] else words
        if name.startswith(("calibrate", "kalman", "diagnose")):
            words += ["--gravity", G] if "--gravity" not in words else []
        self._emptied(folder)
        status, err = self._ran(folder, words)
        if status != 1 or not err.strip():
            return f"FAILED: {words}: status {status}: {err[-300:]!r}"
        left = _left(folder)
        return f"FAILED: {left} left" if left else "device full, refused"

    def _pipe(self, folder: Path, name: str, number: int) -> str:
        _, whole = self.whole[name]
        file = sorted(whole)[0]
        if file.endswith((".parquet", ".npy", ".npz", ".html")):
            return "not of a pipe"
        self._emptied(folder)
        os.mkfifo(folder / file)
        child = self._started(folder, [*LINES[name], "--force"])
        got, status = _read_slowly(folder / file, child, step=int(self.rng(number).integers(500, 20_000)))
        is_pipe = (folder / file).is_fifo()
        (folder / file).unlink()
        if status not in (0, 2) or not is_pipe:
            return f"FAILED: a slow pipe: status {status}, still a pipe: {is_pipe}"
        if not _same(got, whole[file]):
            return f"FAILED: through a slow pipe {len(got)} bytes of {len(whole[file])} came"
        return "slow pipe, whole"

    # A run and its outputs

    def _started(self, folder: Path, words: list[str], limit: int | None = None, told: int | None = None) -> int:
        child = os.fork()
        if child:
            return child
        status = 70
        try:
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            os.chdir(folder)
            if limit is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            out, err = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = main(words)
            if told is not None:
                os.write(told, err.getvalue().encode(errors="replace")[-4000:])
        finally:
            os._exit(status)

    def _ran(self, folder: Path, words: list[str], limit: int | None = None) -> tuple[int, str]:
        heard, told = os.pipe()
        child = self._started(folder, words, limit, told)
        os.close(told)
        with os.fdopen(heard, "rb") as stream:
            err = stream.read().decode(errors="replace")
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status), err

    def _outputs(self, folder: Path, name: str) -> dict[str, bytes]:
        files = {word for word in LINES[name] if word.startswith("OUT")}
        return {file: (folder / file).read_bytes() for file in files}

    def _emptied(self, folder: Path) -> None:
        for path in folder.iterdir():
            if path.name not in self.files and path.name != "six.npy":
                shutil.rmtree(path) if path.is_dir() else path.unlink()

    def _judged(self, folder: Path, name: str, good: str) -> str:
        for file, data in self.whole[name][1].items():
            if not _same((folder / file).read_bytes(), data):
                return f"FAILED: the next run wrote another {file}"
        if left := _left(folder):
            return f"FAILED: {left} left by the next run"
        for file, data in self.files.items():
            if (folder / file).read_bytes() != data:
                return f"FAILED: the input {file} was harmed"
        return good


def _six(path: Path, log: bytes) -> None:
    import numpy as np

    np.save(path, np.ascontiguousarray(np.load(io.BytesIO(log))[:, 1:7]))


def _left(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if ".trihedron-" in path.name or path.name.endswith(".part")]


def _same(found: bytes, data: bytes) -> bool:
    return OF_ITS_DAY.sub(b"", found) == OF_ITS_DAY.sub(b"", data)


def _read_slowly(path: Path, child: int, step: int) -> tuple[bytes, int]:
    """What comes out of a pipe that is read a little at a time, and the status of its writer."""
    got, until, status = bytearray(), time.monotonic() + WAIT_S, None
    pipe = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        while time.monotonic() < until:
            if select.select([pipe], [], [], 0.01)[0]:
                part = os.read(pipe, step)
                got += part
                time.sleep(0.001)
                if part:
                    continue
            if status is None:
                ended, code = os.waitpid(child, os.WNOHANG)
                status = os.waitstatus_to_exitcode(code) if ended else None
                continue
            break
    finally:
        os.close(pipe)
    if status is None:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    return bytes(got), -1 if status is None else status
