"""Deliverables 5, 8, 9 and 10 by the command line: noise of another converter, plans, files of others, `verify`."""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from review_walk.body import EDGES, FACES, G, by_hand
from review_walk.sensor import Part, flicker, read_out, write

DEG = np.pi / 180.0


def trihedron(*words):
    """Exit status, standard output and error of the command."""
    done = subprocess.run([sys.executable, "-m", "trihedron", *map(str, words)], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def session(folder, seed, name="log.csv", part=None, steps=(1.0, 1.0), **motion):
    """A log of poses by hand and its truth."""
    rng = np.random.default_rng([59, seed])
    t, a, w, truth = read_out(by_hand(rng, **motion), Part(**(part or {})), 100.0, rng)
    write(folder / name, t, a, w, steps)
    return folder / name, truth, (t, a, w)


def rest_of_other_converters(folder):
    """`kalman --noise` of a rest log whose converter is not the session's; of its own; each: status and first words."""
    log, _, _ = session(folder, 1)
    rng = np.random.default_rng(2)
    q = 8.0 * G / 2**16
    for name, ratio, offset in (
        ("the same converter", 1.0, 0.0),
        ("of 12 bit", 16.0, 0.0),
        ("of 20 bit", 1.0 / 16.0, 0.0),
        ("a range twice as large", 2.0, 0.0),
        ("unsigned codes", 1.0, 32768.0),
    ):
        x = np.array([0.1, -0.2, G]) + 1e-3 * 10.0 * rng.normal(size=(60_000, 3)) + 2e-4 * flicker(60_000, 100.0, rng)
        counts = np.round(x / (q * ratio)) + offset
        write(folder / "rest.csv", np.arange(60_000) / 100.0, counts, np.round(100.0 * rng.normal(size=x.shape)))
        code, out, err = trihedron("kalman", log, "--gravity", G, "--noise", folder / "rest.csv")
        yield f"kalman --noise, {name}", f"status {code}: {(err.strip() or out.strip()).splitlines()[0][:110]}"


def white_of(folder, x, t):
    """N of each axis by `allan --json`, and its bars."""
    np.savetxt(
        folder / "rest.csv", np.column_stack([t, x]), delimiter=",", header="t,gx,gy,gz", comments="", fmt="%.9f"
    )
    code, out, err = trihedron("allan", folder / "rest.csv", "--gyro-unit", "counts", "--json", "-")
    if not out:
        return f"status {code}: {err.strip()[:120]}"
    terms = [axis["terms"]["N"] for axis in json.loads(out)["axes"]]
    return "N / truth " + ", ".join(f"{1e4 * n['value']:.3f} ± {1e4 * n['sigma']:.3f}" for n in terms)


def noise_of_rest(folder):
    """N from readings on an offset of 1e9, and with 30 % of readings missing here and there."""
    rng = np.random.default_rng(3)
    n = 120_000
    t = np.arange(n) / 100.0
    x = 1e-3 * rng.normal(size=(n, 3)) + 1e-4 * flicker(n, 100.0, rng)
    for name, offset, kept in (
        ("as it is", 0.0, np.ones(n, dtype=bool)),
        ("on an offset of 1e9", 1e9, np.ones(n, dtype=bool)),
        ("30 % of rows missing", 0.0, rng.random(n) > 0.3),
    ):
        yield f"allan, {name}", white_of(folder, x[kept] + offset, t[kept])


def plans(_):
    """σ of a gyro scale from turns, and of the accelerometer from 18 poses, against sums of one's own."""
    code, out, _ = trihedron("plan", "--turns", "1440,-1440", "--turn-time", 8, "--hold", 4, "--gyro-noise", 0.006)
    _, out, _ = trihedron(
        "plan", "--turns", "1440,-1440", "--turn-time", 8, "--hold", 4, "--gyro-noise", 0.006, "--json", "-"
    )
    plan = json.loads(out)
    own = 0.006 * DEG * np.sqrt(8.0) / (8.0 * np.pi) / np.sqrt(2.0)
    yield "plan, σ of a gyro scale from ±8π", f"{plan['turns']['scale']:.4e}, own {own:.4e} (status {code})"
    ups = [u / np.linalg.norm(u) for u in (FACES + EDGES)]
    # r = u·(S u g + b): derivatives by the six of a lower S and b, at a plain triad.
    rows = np.array([[*(np.outer(u, u * G)[np.tril_indices(3)]), *u] for u in ups])
    sigma = plan["accelerometer_density"] / np.sqrt(plan["hold_s"])
    bars = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))) * sigma
    eighteen = next(p for p in plan["poses"] if p["n_poses"] == 18)
    diagonal = np.sqrt(np.mean(bars[[0, 2, 5]] ** 2))
    text = f"scale {eighteen['scale']:.3e}, zero {eighteen['zero']:.3e}; own {diagonal:.3e}, {bars[6:].mean():.3e}"
    yield "plan, 18 poses", text


def numbers(text):
    """Numbers of a text as a stream of doubles reads them: up to the first word that is none."""
    words = text.split()
    is_number = [re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word) is not None for word in words]
    return [float(word) for word in words[: [*is_number, False].index(False)]]


def files_of_others(folder):
    """Each file read as its format says, and its equation evaluated against S raw + b of the calibration file."""
    parts = {"": {}, ", gyro's x mirrored": {"gyro_axes": ((-1, 0, 0), (0, 1, 0), (0, 0, 1))}}
    parts[", gyro's axes permuted"] = {"gyro_axes": ((0, 1, 0), (0, 0, 1), (1, 0, 0))}
    for label, part in parts.items():
        log, _, (_, a, w) = session(folder, 4, part=part)
        cal = folder / "cal.json"
        code, _, err = trihedron("calibrate", log, "--gravity", G, "-o", cal, "--force")
        if not cal.exists():
            yield f"calibrate{label}", f"status {code}: {err[:100]}"
            continue
        kept = json.loads(cal.read_text())
        models = {k: (np.array(kept[k]["S"]), np.array(kept[k]["b"])) for k in ("accelerometer", "gyroscope")}
        raw = {"accelerometer": a[::997], "gyroscope": w[::997]}
        want = {k: raw[k] @ S.T + b for k, (S, b) in models.items()}
        lsb = 8.0 * G / 2**16, 1000.0 / 2**16
        yield f"imu_tk{label}", imu_tk(folder, cal, raw, want)
        yield f"xio{label}", xio(folder, cal, raw, want)
        yield f"kalibr{label}", kalibr(folder, cal, raw, want, lsb)


def apart(got, want):
    """Largest difference."""
    return ", ".join(f"{k[:5]} off by {np.abs(got[k] - want[k]).max():.1e}" for k in want)


def imu_tk(folder, cal, raw, want):
    """Twenty-one doubles a file: T and K row by row, then the bias; x = T K (raw - bias). No word before them."""
    trihedron("export", cal, "--to", "imu_tk", "-o", folder / "tk.calib", "--force")
    got, files = {}, sorted(folder.glob("*tk*"))
    for path in files:
        x = numbers(path.read_text())
        key = "accelerometer" if "acc" in path.name else "gyroscope"
        if len(x) < 21:
            return f"{path.name}: {len(x)} numbers before the first word"
        T, K, b = np.reshape(x[:9], (3, 3)), np.reshape(x[9:18], (3, 3)), np.array(x[18:21])
        got[key] = (raw[key] - b) @ (T @ K).T
    # T of the accelerometer is upper triangular with ones: another frame, in which both sensors must be.
    U, _, V = np.linalg.svd(got["accelerometer"].T @ want["accelerometer"])
    turned = (U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V).T
    text = apart({k: x @ turned.T for k, x in got.items()}, want)
    for path in files:
        path.unlink()
    return text


def xio(folder, cal, raw, want):
    """misalignment ((raw - offset) ∘ sensitivity): g and degrees per second."""
    trihedron("export", cal, "--to", "xio", "-o", folder / "xio.h", "--force")
    text = (folder / "xio.h").read_text()
    got = {}
    for key, unit in (("accelerometer", 9.80665), ("gyroscope", DEG)):
        parts = {}
        for word, size in (("Misalignment", 9), ("Sensitivity", 3), ("Offset", 3)):
            hit = re.search(rf"{key}{word}\b[^=]*=\s*({{.*?}});", text, re.S | re.I)
            if hit is None:
                return f"no {key}{word}"
            values = [float(x) for x in re.findall(r"-?\d+\.?\d*(?:[eE][-+]?\d+)?", hit.group(1))]
            parts[word] = np.array(values[:size])
        M = parts["Misalignment"].reshape(3, 3)
        got[key] = unit * ((raw[key] - parts["Offset"]) * parts["Sensitivity"]) @ M.T
    return apart(got, want)


def kalibr(folder, cal, raw, want, lsb):
    """a_m = M a + b_a, w_m = M C w + A C a + b_w in SI as a driver gives it; C a rotation, M lower triangular."""
    words = ("--accel-lsb", f"{lsb[0] / 9.80665:.12g} g", "--gyro-lsb", f"{lsb[1]:.12g} deg/s")
    code, _, err = trihedron("export", cal, "--to", "kalibr", *words, "-o", folder / "imu.yaml", "--force")
    if code:
        return err[:110]
    imu = yaml.safe_load((folder / "imu.yaml").read_text())
    M_a, M_w, C = (
        np.array(x) for x in (imu["accelerometers"]["M"], imu["gyroscopes"]["M"], imu["gyroscopes"]["C_gyro_i"])
    )
    A = np.array(imu["gyroscopes"]["A"])
    size = {"accelerometer": lsb[0], "gyroscope": lsb[1] * DEG}
    said = {k: raw[k] * size[k] for k in raw}
    # Zeros are no keys of the format: differences only.
    there = {"accelerometer": want["accelerometer"] @ M_a.T, "gyroscope": want["gyroscope"] @ (M_w @ C).T}
    flat = {k: said[k] - said[k].mean(axis=0) for k in said}
    text = apart({k: there[k] - there[k].mean(axis=0) for k in there}, flat)
    lower = max(np.abs(M[np.triu_indices(3, 1)]).max() for M in (M_a, M_w))
    return f"{text}, det C {np.linalg.det(C):+.9f}, above M's diagonal {lower:.0e}, |A| {np.abs(A).max():.0e}"


def verdicts(folder):
    """Status of `verify` on a good calibration, and on calibrations that are off."""
    log, _, _ = session(folder, 6)
    other, _, _ = session(folder, 6, "other.csv", poses=12)
    cal = folder / "cal.json"
    trihedron("calibrate", log, "--gravity", G, "-o", cal, "--force")
    yield "verify, its own log", f"status {trihedron('verify', cal, log, '--gravity', G)[0]}"
    yield "verify, another unit's log", f"status {trihedron('verify', cal, other, '--gravity', G)[0]}"
    for name, key, field, factor in (
        ("accelerometer's scale off by 1 %", "accelerometer", "S", 1.01),
        ("gyro's scale off by 3 %", "gyroscope", "S", 1.03),
        ("accelerometer's scale off by 0.001 %", "accelerometer", "S", 1.00001),
    ):
        kept = json.loads(cal.read_text())
        kept[key][field] = (np.array(kept[key][field]) * factor).tolist()
        (folder / "off.json").write_text(json.dumps(kept))
        code, _, err = trihedron("verify", folder / "off.json", log, "--gravity", G)
        yield f"verify, {name}", f"status {code} {err.strip()[:90]}"


GROUPS = {"5": (rest_of_other_converters, noise_of_rest), "plan": (plans,), "9": (files_of_others,), "10": (verdicts,)}


def run(group, *_):
    """Print a line for each question."""
    for ask in GROUPS[group]:
        with tempfile.TemporaryDirectory() as folder:
            for name, answer in ask(Path(folder)):
                print(f"{name:42s} {answer}", flush=True)
