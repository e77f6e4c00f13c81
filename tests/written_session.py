"""A session as people write it to a file, its calibration, and the one sentence with which a command rejects."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import trihedron
from this_run import once
from trihedron.cli import main
from trihedron.records import Recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

G = "9.80665"


def log_text(recording: Recording, *, columns="time_s,ax,ay,az,gx,gy,gz", scale=1.0):
    rows = np.column_stack([recording.time_s * scale, recording.accelerometer, recording.gyroscope])
    return columns + "\n" + "\n".join(",".join(f"{v:.10g}" for v in row) for row in rows) + "\n"


def simulated(motion, seed=3):
    return simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0]


@cache
def usual():
    """A short session, its calibration and its diagnosis, for what is said of them: made once in a run."""
    return pickle.loads((once("usual", _usual) / "results").read_bytes())


def _usual(folder):
    log = simulated(hand_session(n_poses=14, pose_s=2.0, move_s=1.0))
    gravity = {"gravity_m_s2": float(G)}
    results = log, trihedron.calibrate(log, **gravity), trihedron.diagnose(log, **gravity)
    (folder / "results").write_bytes(pickle.dumps(results))


@pytest.fixture(scope="module")
def recording():
    return simulated(hand_session(n_poses=16, pose_s=3.0, move_s=1.5, first_pose_s=5.0))


@pytest.fixture(scope="module")
def session(tmp_path_factory, recording):
    """A folder with a good log and its calibration."""
    folder = tmp_path_factory.mktemp("session")
    (folder / "log.csv").write_text(log_text(recording))
    assert main(["calibrate", str(folder / "log.csv"), "--gravity", G, "-o", str(folder / "c.json")]) == 0
    return folder


def rejected(capsys, *arguments):
    """The one sentence with which a command rejects."""
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


def rejected_only(capsys, *arguments):
    capsys.readouterr()
    return rejected(capsys, *arguments)
