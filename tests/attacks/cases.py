"""Cases made from a seed and a number: a mutated file for its reader, or a command line."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import signal
import sys
import tempfile
import time
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer

from attacks.mutations import of_bytes, of_json
from small_session import G, made_elsewhere
from trihedron.cli import COMMANDS, build_app, main

LONGEST_S = 10
"""Of the processor's time; a loaded machine may take ``PATIENCE`` times as long by the clock."""
LONGEST_WORK_S = 60
"""Of ``HEAVY`` commands, where they do their work: a demonstration, a diagnosis of every log of a folder."""
PATIENCE = 6
Files = dict[str, str]
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")


class TooLong(BaseException):
    """A case that was still running after ten seconds."""


def _too_long(_number: int, _frame: Any) -> None:
    raise TooLong


class Attack(ABC):
    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.folder = Path(tempfile.mkdtemp(prefix="attack-"))
        self.files = originals()

    def rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, number, len(type(self).__name__)])

    @abstractmethod
    def describe(self, number: int) -> str:
        """What a case does, in one line."""

    @abstractmethod
    def run(self, number: int) -> str:
        """``taken``, ``refused`` or ``FAILED: why``."""

    def longest_s(self, _number: int) -> int:
        """Seconds of the processor that a case may take."""
        return LONGEST_S

    def run_forked(self, numbers: Sequence[int]) -> Iterator[tuple[int, str]]:
        """Outcomes of cases in a child of this process; a case that ends its process, or outlives it, has failed."""
        todo = list(numbers)
        while todo:
            heard, told = os.pipe()
            child = os.fork()
            if child == 0:
                os.close(heard)
                self._child(todo, told)
            os.close(told)
            with os.fdopen(heard) as stream:
                for line in stream:
                    number, outcome = line.rstrip("\n").split(" ", 1)
                    todo.remove(int(number))
                    yield int(number), outcome
            _, status = os.waitpid(child, 0)
            if todo:
                yield todo.pop(0), f"FAILED: the process ended with {status}"

    def _child(self, todo: list[int], told: int) -> None:
        signal.signal(signal.SIGALRM, _too_long)
        noise = os.open(self.folder / f"stderr-{os.getpid()}", os.O_RDWR | os.O_CREAT, 0o600)
        os.dup2(noise, 2)
        for number in todo:
            os.ftruncate(noise, 0)
            longest = self.longest_s(number)
            signal.alarm(PATIENCE * longest)
            # A library that holds the interpreter gets no exception: the process itself is ended.
            signal.setitimer(signal.ITIMER_VIRTUAL, 3 * longest)
            try:
                outcome = self.run(number)
            except TooLong:
                outcome = f"FAILED: longer than {PATIENCE * longest} s"
            except BaseException as error:
                outcome = f"FAILED: {type(error).__name__}: {str(error)[:200]!r}"
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            spoken = os.pread(noise, 2000, 0)
            if b"panicked" in spoken or b"Traceback" in spoken:
                outcome = f"FAILED: on stderr: {spoken[:300]!r}"
            os.write(told, f"{number} {outcome}\n".replace("\r", " ").encode(errors="replace"))
        os._exit(0)


def originals() -> dict[str, bytes]:
    """Good files of every kind, by name."""
    folder = made_elsewhere()
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    rows = np.load(folder / "log.npy")[:400]
    plain = b"\n".join(files["log.csv"].split(b"\n")[:401]) + b"\n"
    buffers = {name: io.BytesIO() for name in ("npy", "npz", "zip", "gz", "npz1")}
    np.save(buffers["npy"], rows)
    np.savez_compressed(buffers["npz"], counts=np.tile(rows[:, None, 1:], (1, 2, 1)), t_s=rows[:, 0], fs_hz=100.0)
    np.savez(buffers["npz1"], t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])
    with zipfile.ZipFile(buffers["zip"], "w", zipfile.ZIP_DEFLATED) as archive:
        for name, columns in (("Accelerometer.csv", (0, 1, 2, 3)), ("Gyroscope.csv", (0, 4, 5, 6))):
            text = "time,x,y,z\n" + "\n".join(",".join(f"{v:.8g}" for v in row) for row in rows[:, columns])
            archive.writestr(name, text)
    import gzip

    buffers["gz"].write(gzip.compress(plain))
    files |= {"short.csv": plain, "a.npy": buffers["npy"].getvalue(), "a.npz": buffers["npz"].getvalue()}
    files |= {"b.npz": buffers["npz1"].getvalue(), "a.zip": buffers["zip"].getvalue(), "a.gz": buffers["gz"].getvalue()}
    quoted = b"\n".join(b",".join(b'"' + c + b'"' for c in line.split(b",")) for line in plain.split(b"\n")[:-1])
    files["quoted.csv"] = quoted + b"\n"
    files["axis.json"] = b'{"white": 0.002, "walk": [1e-5, 1e-5, 2e-5]}'
    files["poses.csv"] = b"pitch,roll,hold\n" + b"".join(b"%d,%d,%d\n" % (10 * k, 5 * k, k + 1) for k in range(12))
    files["curve.csv"] = b"tau_s,adev\n" + b"".join(b"%g,%g\n" % (2**k, 1 / (1 + k)) for k in range(12))
    files["frame.toml"] = (
        b'name = "x"\nsync = "AA 55"\nlength = 16\n[checksum]\nkind = "xor8"\n'
        b'[[field]]\nname = "ax"\ntype = "i16"\nat = 2\nscale = 0.001\nunit = "g"\nrole = "value"\n'
    )
    return files


def _readers() -> dict[str, list[Callable[[Path], object]]]:
    from trihedron.files.calibration import read_calibration
    from trihedron.files.diagnosis import read_diagnosis
    from trihedron.files.frame_declaration import read_frame_declaration
    from trihedron.files.noise import read_noise
    from trihedron.files.scenario import improved_scenario
    from trihedron.pipeline.exporting import export
    from trihedron.read import read_recording
    from trihedron.read.allan_table import read_allan_table
    from trihedron.read.axis_noise import read_axis_noise
    from trihedron.read.pose_table import read_pose_table
    from trihedron.simulate.scenario_file import read_scenario

    def log(path: Path) -> object:
        recording = read_recording(path, device=1) if path.name == "a.npz" else read_recording(path)
        reported = round(sum(finding.numbers.get("rows_left_out", 0.0) for finding in recording.findings))
        assert recording.rows_in_file == recording.rows_read + reported, "rows are not accounted for"
        assert np.all(np.isfinite(recording.time_s)), "a time that is not finite"
        return recording

    def calibration(path: Path) -> object:
        known = read_calibration(path)
        return export(known, "python") if "python" in sys.argv else known

    return {
        **{name: [log] for name in ("a.npy", "a.npz", "b.npz", "a.zip", "a.gz", "short.csv", "quoted.csv")},
        "c.json": [calibration],
        "untrusted.json": [read_calibration],
        "noise.json": [read_noise],
        "diagnosis.json": [read_diagnosis],
        "axis.json": [read_axis_noise],
        "s.toml": [read_scenario, lambda path: improved_scenario(path, {}, [("dropped-samples", {"rate": 0.1})])],
        "frame.toml": [read_frame_declaration],
        "poses.csv": [lambda path: read_pose_table(path, gravity_m_s2=9.8)],
        "curve.csv": [read_allan_table],
    }


class Inputs(Attack):
    """Mutated files, each given to its reader."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.readers = _readers()
        self.names = sorted(self.readers)

    def _case(self, number: int) -> tuple[str, bytes]:
        rng = self.rng(number)
        name = self.names[number % len(self.names)]
        data = self.files[name]
        if name.endswith(".json") and rng.random() < 0.6:
            return name, of_json(rng, data)
        return name, of_bytes(rng, data)

    def describe(self, number: int) -> str:
        name, data = self._case(number)
        return f"{name}, {len(data)} bytes"

    def run(self, number: int) -> str:
        name, data = self._case(number)
        path = self.folder / f"{os.getpid()}" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        try:
            for reader in self.readers[name]:
                with np.errstate(all="ignore"):
                    reader(path)
        except AssertionError as error:
            return f"FAILED: {error}"
        except ValueError as error:
            text = str(error)
            if not text or len(text) > 1500 or "panicked" in text or text.count("\n") > 12:
                return f"FAILED: the refusal is {text[:300]!r}"
            return "refused"
        return "taken"


HEAVY = {"demo", "diagnose", "fleet"}
RARE = {"demo", "diagnose"}
NEVER = {"--serve", "--browser", "--guide", "--link", "--help", "--version", "--bell"}
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
            value = self._value(rng, flag, parameter, is_tame)
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

    def _value(self, rng: np.random.Generator, flag: str, parameter: Any, is_tame: bool) -> str:
        if flag in BY_OPTION:
            return str(rng.choice(BY_OPTION[flag]))
        kind = repr(parameter.type_descriptor.annotation)
        if "Path" in kind:
            name = flag.lstrip("-")
            if name in ("calibration",):
                return str(
                    rng.choice(["c.json", "untrusted.json", "noise.json", *([] if is_tame else ["bad.json", *SPECIAL])])
                )
            if name in ("output", "json", "report", "csv", "plot", "truth", "updated", "improved"):
                endings = [".csv", ".json", ".html", ".txt", ".png", ".npz", ".parquet", ".toml", ""]
                made = f"out{int(rng.integers(3))}{rng.choice(endings)}"
                return str(rng.choice([made, made, made, *(["c.json", "log.csv"] if is_tame else SPECIAL)]))
            if name in ("noise",):
                return str(rng.choice(["noise.json", "axis.json", "rest.csv", "bad.json"]))
            if name in ("with-effects", "diagnosis"):
                return str(rng.choice(["diagnosis.json", "c.json", "bad.json"]))
            if name == "reference":
                return str(rng.choice(["poses.csv", "bad.csv"]))
            pool = ["log.csv", "short.csv", "rest.csv", "a.npy", "b.npz", "a.zip", "a.gz", "quoted.csv"]
            return str(
                rng.choice(pool if is_tame else [*pool, "bad.csv", "bad.npy", "bad.npz", "bad.gz", "c.json", *SPECIAL])
            )
        if flag.lstrip("-") == "scenario":
            return str(rng.choice(["s.toml", "bad.toml", "hand-session", "x", "missing.toml"]))
        if flag.lstrip("-") == "port":
            return str(
                rng.choice(["short.csv", "bad.csv", "missing", "a.npy", "/dev/null", "tcp://", "tcp://127.0.0.1:1"])
            )
        if "int" in kind or "float" in kind:
            return str(rng.choice(["1", "2", "100", "0.01", "60", *([] if is_tame else WORDS)]))
        return str(rng.choice(WORDS))

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
        files = (before, _content(folder))
        return self._judged(words, status, out.getvalue(), err.getvalue(), files, took)

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
        for name, ending in (
            ("c.json", "json"),
            ("short.csv", "csv"),
            ("a.npy", "npy"),
            ("b.npz", "npz"),
            ("a.gz", "gz"),
        ):
            data = self.files[name]
            is_json = ending == "json" and rng.random() < 0.7
            (folder / f"bad.{ending}").write_bytes(of_json(rng, data) if is_json else of_bytes(rng, data))
        (folder / "bad.toml").write_bytes(of_bytes(rng, self.files["s.toml"]))
        return folder

    def _judged(
        self,
        words: list[str],
        status: int,
        out: str,
        err: str,
        files: tuple[dict[str, str], dict[str, str]],
        took: float,
    ) -> str:
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
        return {0: "taken", 1: "refused", 2: "doubted"}[status]


def _may_be_made(name: str, named: set[str]) -> bool:
    """An output that was asked for, or a companion of one (a header beside a source, a demonstration's folder)."""
    stems = {os.path.splitext(word)[0] for word in named if word}
    top = name.split("/")[0]
    return any(top.startswith(stem) for stem in stems) or top.startswith("trihedron-demo")


def _content(folder: Path) -> dict[str, str]:
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found
