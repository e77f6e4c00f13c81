"""Every export, read back and evaluated by its target's own equation, against ``trihedron.apply``.

    python benches/formats/exports.py [--write docs/export.md]

One simulated session is calibrated from counts whose size is said to the targets that want SI. The target's equation is
evaluated here on the numbers of the file, without our exporters; where the target's parser is installed the file goes
through it (OpenCV for OpenVINS and VINS-Fusion, PyYAML for Kalibr, pymavlink for ArduPilot, pyins for pyins, a C and a
Rust compiler). Largest differences over 2000 readings of up to 40 m/s² and 10 rad/s.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

import trihedron
from trihedron.files.formats import upper_frame
from trihedron.records import Calibration, Recording

G = 9.80665
ACCEL_LSB, GYRO_LSB = G / 16384, float(np.radians(1 / 131.0))
Files = dict[str, str]
Pair = tuple[np.ndarray, np.ndarray]
EVALUATED: dict[str, tuple[str, Callable[[Files, np.ndarray, np.ndarray], Pair]]] = {}


def target(name: str, by: str) -> Callable:
    def keep(make: Callable[[Files, np.ndarray, np.ndarray], Pair]) -> Callable:
        EVALUATED[name] = (by, make)
        return make

    return keep


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", text)]


def undo(M: np.ndarray, b: np.ndarray, readings: np.ndarray) -> np.ndarray:
    return np.linalg.solve(M, (readings - b).T).T


@target("python", "exec")
def _python(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    scope: dict = {}
    exec(files[""], scope)
    correct = scope["correct"]
    return (
        correct(a, scope["S_ACCELEROMETER"], scope["B_ACCELEROMETER"]),
        correct(w, scope["S_GYROSCOPE"], scope["B_GYROSCOPE"]),
    )


def _compiled(folder: Path, program: Path, a: np.ndarray, w: np.ndarray) -> Pair:
    rows = "\n".join(" ".join(repr(float(v)) for v in row) for row in np.hstack([a, w]))
    done = subprocess.run([program], input=rows, capture_output=True, text=True, check=True, cwd=folder)
    out = np.array([numbers(line) for line in done.stdout.splitlines()])
    return out[:, :3], out[:, 3:]


@target("c", "cc -Wall -Wextra -Wpedantic -Werror")
def _c(files: Files, a: np.ndarray, w: np.ndarray, suffix: str = "", real: str = "double") -> Pair:
    code = f"""#include <stdio.h>
    #include "calibration.h"
    int main(void) {{
        double in[6]; {real} r[3], g[3], f[3], w[3]; int i;
        while (scanf("%lf %lf %lf %lf %lf %lf", in, in + 1, in + 2, in + 3, in + 4, in + 5) == 6) {{
            for (i = 0; i < 3; ++i) {{ r[i] = ({real})in[i]; g[i] = ({real})in[i + 3]; }}
            trihedron_correct{suffix}(&trihedron_accelerometer{suffix}, r, f);
            trihedron_correct{suffix}(&trihedron_gyroscope{suffix}, g, w);
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", f[0], f[1], f[2], w[0], w[1], w[2]);
        }}
        return 0;
    }}"""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "calibration.h").write_text(files[""])
        (folder / "main.c").write_text(code)
        flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
        subprocess.run(["cc", *flags, "main.c", "-o", "main"], check=True, cwd=folder)
        return _compiled(folder, folder / "main", a, w)


@target("c (float)", "cc, single precision")
def _c_float(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    return _c(files, a, w, "_f", "float")


@target("rust", "rustc, no_std library")
def _rust(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    code = """#![deny(warnings)]
    mod calibration;
    fn main() {
        for line in std::io::stdin().lines() {
            let v: Vec<f64> = line.unwrap().split_whitespace().map(|w| w.parse().unwrap()).collect();
            let f = calibration::ACCELEROMETER.correct([v[0], v[1], v[2]]);
            println!("{:?} {:?}", f, calibration::GYROSCOPE.correct([v[3], v[4], v[5]]));
        }
    }"""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "calibration.rs").write_text(files[""])
        (folder / "bare.rs").write_text("#![no_std]\n#![deny(warnings)]\npub mod calibration;\n")
        (folder / "main.rs").write_text(code)
        subprocess.run(["rustc", "--edition", "2021", "--crate-type", "lib", "bare.rs"], check=True, cwd=folder)
        subprocess.run(["rustc", "--edition", "2021", "main.rs"], check=True, cwd=folder)
        return _compiled(folder, folder / "main", a, w)


@target("kalibr", "PyYAML")
def _kalibr(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    document = yaml.safe_load(files[""])
    acc = {key: np.array(value) for key, value in document["accelerometers"].items()}
    gyr = {key: np.array(value) for key, value in document["gyroscopes"].items()}
    force = undo(acc["M"], acc["b"], a)
    C = gyr["C_gyro_i"]
    return force, undo(gyr["M"] @ C, gyr["b"], w - force @ (gyr["A"] @ C).T)


def _opencv(text: str) -> object:
    import cv2

    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write(text)
        file.flush()
        return cv2.FileStorage(file.name, cv2.FILE_STORAGE_READ)


@target("openvins", "OpenCV FileStorage")
def _openvins(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    storage = _opencv(files[""])
    imu = storage.getNode("imu0")

    def matrix(name: str) -> np.ndarray:
        node = imu.getNode(name)
        return np.array([[node.at(i).at(j).real() for j in range(3)] for i in range(3)])

    b_a, b_w = (
        np.array(numbers(re.search(rf"#   {n} \[(.*)\]", files[""])[1])) for n in ("accelerometer", "gyroscope")
    )
    force = undo(matrix("Ta"), b_a, a)
    return force, undo(matrix("Tw"), b_w, w - force @ matrix("Tg").T) @ matrix("R_IMUtoGYRO")


@target("vins-fusion", "OpenCV FileStorage")
def _vins_fusion(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    storage = _opencv(files[""])
    assert storage.getNode("g_norm").real() > 9.0
    return a, w


@target("ros", "PyYAML")
def _ros(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    assert len(yaml.safe_load(files[""])["linear_acceleration_covariance"]) == 9
    return a, w


@target("basalt", "json")
def _basalt(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    value = json.loads(files[""])["value0"]
    p, q = np.array(value["calib_accel_bias"]), np.array(value["calib_gyro_bias"])
    M = np.array([[p[3], 0, 0], [p[4], p[6], 0], [p[5], p[7], p[8]]])
    return a @ (np.eye(3) + M).T - p[:3], w @ (np.eye(3) + q[3:].reshape(3, 3).T).T - q[:3]


@target("px4", "lines of QGroundControl's .params")
def _px4(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    rows = [line.split("\t") for line in files[""].splitlines() if not line.startswith("#")]
    v = {row[2]: float(row[3]) for row in rows}
    names = (("ACC0", "OFF"), ("ACC0", "SCALE"), ("GYRO0", "OFF"))
    off, scale, zero = (np.array([v[f"CAL_{n}_{x}{k}"] for x in "XYZ"]) for n, k in names)
    return (a - off) * scale, w - zero


@target("ardupilot", "pymavlink mavparm")
def _ardupilot(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    from pymavlink import mavparm

    parameters = mavparm.MAVParmDict()
    with tempfile.NamedTemporaryFile("w", suffix=".parm") as file:
        file.write(files[""])
        file.flush()
        assert parameters.load(file.name)
    off, scale, zero = (
        np.array([parameters[f"INS_{n}_{x}"] for x in "XYZ"]) for n in ("ACCOFFS", "ACCSCAL", "GYROFFS")
    )
    return (a - off) * scale, w - zero


@target("imu_tk", "21 numbers, as its reader takes them")
def _imu_tk(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    out = []
    for ending, readings in (("_acc.calib", a), ("_gyro.calib", w)):
        v = np.array([float(word) for word in files[ending].split()[:21]])
        out.append((readings - v[18:]) @ (v[:9].reshape(3, 3) @ v[9:18].reshape(3, 3)).T)
    return out[0], out[1]


@target("xio", "C arrays")
def _xio(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    v = {m[1]: np.array(numbers(m[2])) for m in re.finditer(r"(\w+) = \{([^}]*)\};", files[""])}
    out = []
    for name, readings, unit in (("accelerometer", a, G), ("gyroscope", w, np.pi / 180)):
        M = v[f"{name}Misalignment"].reshape(3, 3)
        out.append(unit * (v[f"{name}Sensitivity"] * (readings - v[f"{name}Offset"])) @ M.T)
    return out[0], out[1]


@target("pyins", "pyins Parameters")
def _pyins(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    from pyins.inertial_sensor import Parameters

    scope: dict = {}
    exec(files[""], scope)
    out = []
    for name, readings in (("accel", a), ("gyro", w)):
        own = Parameters(scope[f"{name}_transform"], scope[f"{name}_bias"])
        out.append(undo(own.transform, own.bias, readings))
    return out[0], out[1]


@target("realsense", "json")
def _realsense(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    imu = json.loads(files[""])["imus"][0]
    out = []
    for name, readings in (("accelerometer", a), ("gyroscope", w)):
        X = np.reshape(imu[name]["scale_and_alignment"], (3, 3))
        out.append(readings @ X - imu[name]["bias"])
    return out[0], out[1]


@target("imucal", "json")
def _imucal(files: Files, a: np.ndarray, w: np.ndarray) -> Pair:
    p = {key: np.array(value) for key, value in json.loads(files[""]).items() if isinstance(value, list)}
    force = undo(p["K_a"] @ p["R_a"], p["b_a"], a)
    return force, np.radians(undo(p["K_g"] @ p["R_g"], p["b_g"], w - force @ p["K_ga"].T))


SI_TARGETS = {"kalibr", "openvins", "vins-fusion", "ros", "basalt", "px4", "ardupilot", "realsense"}
TURNED = {"imu_tk"}


def lost_in(files: Files) -> str:
    """The sentences of the files that say what is lost, once each."""
    lines = [line.strip("# /*").strip() for text in files.values() for line in text.splitlines()]
    said = [line for line in lines if "is lost" in line or "this is lost" in line]
    return " ".join(dict.fromkeys(said))


def main() -> int:
    session, _ = trihedron.simulate("hand-session", 5)
    result = trihedron.calibrate(session, latitude_deg=60.0)
    known: Calibration = result.calibration
    rng = np.random.default_rng(1)
    force, rate = rng.uniform(-40, 40, (2000, 3)), rng.uniform(-10, 10, (2000, 3))
    counts = [np.linalg.solve(s.S, (v - s.b).T).T for s, v in ((known.accelerometer, force), (known.gyroscope, rate))]
    log = replace(
        session,
        time_s=np.arange(2000) / 100,
        accelerometer=counts[0],
        gyroscope=counts[1],
        temperature_degc=None,
        supply_v=None,
        auxiliary=type(session.auxiliary)({}),
    )
    applied: Recording = trihedron.apply(known, log)
    rest = rng.normal([0, 0, G, 0, 0, 0], [0.02] * 3 + [0.002] * 3, (20000, 6))
    noise = trihedron.allan({"t": np.arange(20000) / 100, "acc": rest[:, :3], "gyr": rest[:, 3:]})
    sizes = {"accelerometer_lsb": f"{ACCEL_LSB!r} m/s^2", "gyroscope_lsb": f"{GYRO_LSB!r} rad/s"}
    rows = []
    for name in ("c", "c (float)", *(t for t in EVALUATED if not t.startswith("c"))):
        by, evaluate = EVALUATED[name]
        key = name.split()[0]
        in_si = key in SI_TARGETS
        files = trihedron.export(
            known, key, noise=noise, rate_hz=100.0, current_parameters="none", **(sizes if in_si else {})
        )
        a, w = counts[0] * (ACCEL_LSB if in_si else 1.0), counts[1] * (GYRO_LSB if in_si else 1.0)
        try:
            f, r = evaluate(files, np.asarray(a), np.asarray(w))
        except ImportError as error:
            rows.append(f"| {name} | {by} | not installed: {error.name} | | |")
            continue
        turn = upper_frame(known)[0] if key in TURNED else np.eye(3)
        off = [np.abs(x - y @ turn.T).max() for x, y in ((f, applied.accelerometer), (r, applied.gyroscope))]
        rows.append(f"| {name} | {by} | {off[0]:.1g} | {off[1]:.1g} | {lost_in(files)} |")
    head = "| `--to` | read back by | accelerometer [m/s²] | gyro [rad/s] | lost, as the file says |\n"
    head += "|---|---|---|---|---|\n"
    text = head + "\n".join(rows) + "\n"
    print(text)
    if "--write" in sys.argv:
        path = Path(sys.argv[sys.argv.index("--write") + 1])
        before, mark, _ = path.read_text().partition("<!-- measured -->\n")
        path.write_text(before + mark + "\n" + text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
