"""Command lines made at random, run in a folder of their own."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import typer

from attacks.cases import CONTROL, LONGEST_S, LONGEST_WORK_S, Attack
from attacks.mutations import of_bytes, of_json
from small_session import G
from trihedron.cli import COMMANDS, build_app, main

HEAVY = {"demo", "diagnose", "fleet"}
RARE = {"demo", "diagnose"}
NEVER = {"--serve", "--guide", "--link", "--help", "--version"}
WORDS = ["", "x", "nan", "inf", "-1", "0", "1", "1e300", "1e-300", "9" * 400, "\x1b[31m", "é", "0.5", "100", "--", "-"]
SPECIAL = ["missing", "/dev/null", "/dev/zero", "/dev/full", ".", "loop", "fifo", "a\x1b[2Jb", "n" * 300, "sub/x", "-"]
BY_OPTION = {
    "--columns": ["t,ax,ay,az,gx,gy,gz", "ax,ay,az", "time=1,ax=2,ay=3,az=4", "x=9", "ax=1,ax=1", ",,,", "time=none"],
    "--to": ["c", "rust", "python", "kalibr", "openvins", "ros", "px4", "imu_tk", "x"],
    "--method": ["faces", "norm", "joint", "x"],
    "--frame": ["lower", "symmetric", "x"],
    "--accel-unit": ["g", "m/s^2", "counts", "x"],
    "--gyro-unit": ["deg/s", "rad/s", "x"],
    "--time-unit": ["s", "ms", "us", "ns", "x"],
    "--exclude": ["1:2", ":3", "5:", "x", "3:1", "nan:inf"],
    "--accel-lsb": ["0.061 mg", "x", "0 g", "-1 mg", "1e400 g"],
    "--gyro-lsb": ["0.03 deg/s", "x", "nan deg/s"],
    "--accuracy": ["10", "accel 0.05 %, gyro 0.1 %", "x"],
}
OUTPUTS = {"output", "json", "report", "csv", "plot", "truth", "improved"}
ENDINGS = [".csv", ".json", ".html", ".txt", ".png", ".npz", ".parquet", ".toml", ""]
LOGS = ["log.csv", "short.csv", "static.csv", "a.npy", "b.npz", "a.zip", "a.gz", "quoted.csv"]
# Files in the place of an input, and what else stands there in half of the cases.
BY_FILE = {
    "calibration": (["c.json", "untrusted.json", "noise.json"], ["bad.json", *SPECIAL]),
    "noise": (["noise.json", "axis.json", "static.csv", "bad.json"], []),
    "reference": (["poses.csv", "bad.csv"], []),
}
BY_NAME = {
    "scenario": ["s.toml", "bad.toml", "hand-session", "x", "missing.toml"],
    "port": ["short.csv", "bad.csv", "missing", "a.npy", "/dev/null", "tcp://", "tcp://127.0.0.1:1"],
}


class Commands(Attack):
    """Command lines: any command, any of its options, with what people and programs put in their places."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        group = typer.main.get_command(build_app())
        self.commands = {name: command.params for name, command in group.commands.items()}  # type: ignore[attr-defined]
        assert len(self.commands) == len(COMMANDS)

    def longest_s(self, number: int) -> int:
        return LONGEST_WORK_S if self.words(number)[0] in HEAVY else LONGEST_S

    def words(self, number: int) -> list[str]:
        rng = self.rng(number)
        names = [name for name in self.commands if name not in RARE or rng.random() < 0.15]
        name = str(rng.choice(names))
        words: list[str] = [name]
        is_tame = rng.random() < 0.5
        for parameter in self.commands[name]:
            flag = max(parameter.opts, key=len)
            if flag in NEVER:
                continue
            is_argument = parameter.param_type_name == "argument"
            if not is_argument and rng.random() > (0.9 if parameter.required else 0.12):
                continue
            if is_argument and rng.random() < 0.05:
                continue
            value = str(rng.choice(self._values(rng, flag, parameter, is_tame)))
            if is_argument:
                words.append(value)
            elif "bool" in repr(parameter.type_descriptor.annotation):
                words.append(flag)
            else:
                words += [flag, value]
        if name in ("calibrate", "kalman", "diagnose", "verify") and rng.random() < 0.6:
            words += ["--gravity", G]
        if rng.random() < 0.1:
            at = int(rng.integers(len(words) + 1))
            words.insert(at, str(rng.choice(["--nonsense", "-x", "--json", "--force", "--full", *WORDS])))
        return words

    def _values(self, rng: np.random.Generator, flag: str, parameter: Any, is_tame: bool) -> list[str]:
        """What may stand in the place of a parameter."""
        name, kind = flag.lstrip("-"), repr(parameter.type_descriptor.annotation)
        if flag in BY_OPTION:
            return BY_OPTION[flag]
        if "Path" in kind and name in OUTPUTS:
            made = f"out{int(rng.integers(3))}{rng.choice(ENDINGS)}"
            return [made, made, made, *(["c.json", "log.csv"] if is_tame else SPECIAL)]
        if "Path" in kind:
            tame, wild = BY_FILE.get(name, (LOGS, ["bad.csv", "bad.npy", "bad.npz", "bad.gz", "c.json", *SPECIAL]))
            return tame if is_tame else [*tame, *wild]
        if name in BY_NAME:
            return BY_NAME[name]
        is_number = "int" in kind or "float" in kind
        return ["1", "2", "100", "0.01", "60", *([] if is_tame else WORDS)] if is_number else WORDS

    def describe(self, number: int) -> str:
        return json.dumps(self.words(number))

    def run(self, number: int) -> str:
        rng = self.rng(number)
        words = self.words(number)
        folder = self._sandbox(rng)
        before = _content(folder)
        out, err = io.StringIO(), io.StringIO()
        began = time.process_time()
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = main(words)
        finally:
            os.chdir("/")
        took = time.process_time() - began
        return self._judged(words, status, out.getvalue(), err.getvalue(), [before, _content(folder)], took)

    def _sandbox(self, rng: np.random.Generator) -> Path:
        folder = self.folder / f"{os.getpid()}"
        if not folder.exists():
            folder.mkdir()
            (folder / "loop").symlink_to("loop")
            os.mkfifo(folder / "fifo")
        for path in folder.iterdir():
            if path.name not in self.files and path.name not in ("loop", "fifo"):
                path.unlink() if not path.is_dir() else None
        for name, data in self.files.items():
            path = folder / name
            if not path.exists() or path.stat().st_size != len(data):
                path.write_bytes(data)
        for name in ("c.json", "short.csv", "a.npy", "b.npz", "a.gz"):
            data, ending = self.files[name], name.partition(".")[2]
            is_json = ending == "json" and rng.random() < 0.7
            (folder / f"bad.{ending}").write_bytes(of_json(rng, data) if is_json else of_bytes(rng, data))
        (folder / "bad.toml").write_bytes(of_bytes(rng, self.files["s.toml"]))
        return folder

    def _judged(self, words: list[str], status: int, out: str, err: str, files: list[dict], took: float) -> str:
        before, after = files
        said = f"status {status}: {err[-300:]!r}"
        if status not in (0, 1, 2):
            return f"FAILED: {said}"
        if "Traceback" in err or "internal error" in err or "panicked" in err + out:
            return f"FAILED: {said}"
        if CONTROL.search(err) or CONTROL.search(out):
            return f"FAILED: control characters; {said}"
        if status == 1 and "trihedron: " not in err:
            return f"FAILED: no sentence; {said}"
        if status == 2 and not err.strip():
            return f"FAILED: no reason; {said}"
        if took > (LONGEST_WORK_S if words[0] in HEAVY and status != 1 else LONGEST_S):
            return f"FAILED: {took:.0f} s; {said}"
        named = set(words)
        for name, digest in before.items():
            if name not in named and after.get(name) != digest:
                return f"FAILED: {name} was harmed; {said}"
            if name in self.files and after.get(name) != digest and "--force" not in words:
                return f"FAILED: {name} was replaced without --force; {said}"
        left = [n for n in set(after) - set(before) if ".trihedron-" in n or not _may_be_made(n, named)]
        if left:
            return f"FAILED: {left} left; {said}"
        if status == 1 and any(n in after for n in named if n.startswith("out") and n not in before):
            return f"half: status 1 with an output; {said}"
        return {0: "taken", 1: "rejected", 2: "doubted"}[status]


def _may_be_made(name: str, named: set[str]) -> bool:
    """An output that was requested, or a companion of one (a header beside a source, a demonstration's folder)."""
    stems = {os.path.splitext(word)[0] for word in named if word}
    top = name.split("/")[0]
    return any(top.startswith(stem) or name.startswith(stem) for stem in stems) or top.startswith("trihedron-demo")


def _content(folder: Path) -> dict[str, str]:
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found
