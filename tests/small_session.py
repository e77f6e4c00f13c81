"""One short session with everything that commands read, made once and copied wherever a test wants to harm it; how
sessions are written, what is made of a usual one, and the one sentence with which a command rejects."""

import json
import os
import pickle
import shutil
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np

import trihedron
from this_run import once, place
from trihedron.cli import main
from trihedron.records import Recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

G = "9.80665"
SCENARIO = """name = "small"
profile = "mpu"
unit = 3
table_tilt_deg = [0.1, -0.2]

[session]
kind = "hand"
n_poses = 8
pose_s = 1.5
move_s = 1.0
first_pose_s = 3.0

[environment]
gravity_m_s2 = 9.80665

[accelerometer]
noise = { N = [1e-3, 1e-3, 1e-3] }

[[effect]]
id = "gyro-g-sensitivity"
matrix = [[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]]
"""


def rows_of(recording: Recording) -> np.ndarray:
    return np.column_stack([recording.time_s, recording.accelerometer, recording.gyroscope])


def log_text(rows: np.ndarray) -> str:
    """(n, 7) rows as people write them to a file."""
    return "time_s,ax,ay,az,gx,gy,gz\n" + "\n".join(",".join(f"{v:.10g}" for v in row) for row in rows) + "\n"


def simulated(motion, seed=3) -> Recording:
    return simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0]


@cache
def usual():
    """A short session, its calibration and its diagnosis, for what is said of them: made once in a run."""
    return pickle.loads((once("usual", _usual) / "results").read_bytes())


def _usual(folder: Path) -> None:
    log = simulated(hand_session(n_poses=14, pose_s=2.0, move_s=1.0))
    gravity = {"gravity_m_s2": float(G)}
    results = log, trihedron.calibrate(log, **gravity), trihedron.diagnose(log, **gravity)
    (folder / "results").write_bytes(pickle.dumps(results))


def made_once() -> Path:
    """Folder with log.csv, log.npy, static.csv, c.json, untrusted.json, noise.json and s.toml."""
    return once("session", _made)


def _made(folder: Path) -> None:
    rows = rows_of(simulated(hand_session(n_poses=12, pose_s=2.0, move_s=1.0, first_pose_s=4.0)))
    (folder / "log.csv").write_text(log_text(rows))
    np.save(folder / "log.npy", rows)
    rng = np.random.default_rng(5)
    rest = np.column_stack([np.arange(3000) / 100.0, rng.normal([0, 0, 9.8, 0, 0, 0], 0.01, (3000, 6))])
    (folder / "static.csv").write_text(log_text(rest))
    (folder / "s.toml").write_text(SCENARIO)
    log, known = str(folder / "log.csv"), folder / "c.json"
    quietly("calibrate", log, "--gravity", G, "-o", str(known))
    quietly("allan", str(folder / "static.csv"), "--json", str(folder / "noise.json"))
    document = json.loads(known.read_text())
    finding = {"code": "not-observable", "severity": "serious", "seen": "Scale 3 is not determined."}
    document["findings"] = [finding | {"cause": "", "action": "", "numbers": {}}]
    document["is_trustworthy"] = False
    (folder / "untrusted.json").write_text(json.dumps(document))


def made_elsewhere() -> Path:
    """The same, made by a process of its own: this one has then read no table and can fork."""
    if not place("session").exists():
        code = "from small_session import made_once; made_once()"
        path = os.pathsep.join([str(Path(__file__).parent), *(p for p in sys.path if p)])
        subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONPATH": path})
    return place("session")


def quietly(*arguments: str) -> int:
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        return main(list(arguments))


def copied(tmp_path: Path) -> Path:
    """A copy of the session's files that may be harmed."""
    folder = tmp_path / "session"
    shutil.copytree(made_once(), folder)
    return folder


def started(*arguments: object, **options) -> subprocess.Popen:
    """The command as a process of its own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    environment.update(options.pop("env", {}))
    return subprocess.Popen(
        [sys.executable, "-m", "trihedron", *map(str, arguments)],
        stdout=options.pop("stdout", subprocess.PIPE),
        stderr=subprocess.PIPE,
        env=environment,
        **options,
    )


def run(*arguments: object, **options) -> tuple[int, str, str]:
    """Status, stdout and stderr of the command as a process."""
    process = started(*arguments, **options)
    out, err = process.communicate(timeout=120)
    return process.returncode, (out or b"").decode(), err.decode()


def leftovers(folder: Path) -> list[str]:
    return [p.name for p in folder.rglob(".*trihedron*")]


def rejected(capsys, *arguments: object) -> str:
    """The one sentence with which a command rejects."""
    capsys.readouterr()
    status = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert status == 1, (status, err)
    assert out == ""
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("trihedron: ")
    assert "Traceback" not in err
    assert len(lines[0]) < 400
    return lines[0]
