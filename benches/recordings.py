"""Every public set of recordings, gravity the only input (the recordings are not part of the repository).

python benches/recordings.py calibrate FOLDER [WORD ...]   residuals, cross-validated errors, published parameters
python benches/recordings.py diagnose FOLDER [WORD ...]    the table of docs/diagnosis-real.md
"""

import json
import os
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl

import trihedron


def recordings(folder: Path):
    """Name, arguments of the reader (or readings in memory), gravity."""
    pair = {"accelerometer_path": folder / "xsens_mti/xsens_acc.txt",
            "gyroscope_path": folder / "xsens_mti/xsens_gyro.txt"}  # fmt: skip
    yield "xsens_mti", pair, 9.81744
    for k in range(3):
        yield f"mpu9150 unit {k}", {"path": folder / f"mpu9150/imu{k}.log", "rate_hz": 100.0}, 9.8
    for k in (1, 2, 3):
        yield f"kim run {k}", {"path": folder / f"kim/kim_imu_good{k}.txt"}, 9.79871
    for k in (2, 3, 4, 5, 7):
        yield f"mimu4444 exp {k}", {"path": folder / f"mimu4444/exp_{k}.npz", "instance": 1}, 9.8184
    for k in (2, 3):
        names = [next((folder / "phone").glob(f"rec_{k}*__{w}.csv")) for w in ("Acceleration", "AngularVelocity")]
        yield f"phone rec_{k}", {"accelerometer_path": names[0], "gyroscope_path": names[1]}, 9.7974
    yield "mpu6050_tomi poses", {"path": folder / "mpu6050_tomi/tomi_example_data_calibration.csv"}, 9.8
    yield "mpu6050_tomi rest", {"path": folder / "mpu6050_tomi/tomi_example_data_tinit_calc.csv"}, 9.8
    yield "imucal_ferraris", {"path": folder / "imucal_ferraris/example_ferraris_session.csv", "rate_hz": 102.4}, 9.81
    for name in ("bmi160", "adxl355"):
        yield f"openaxes {name}", {"path": folder / f"openaxes/{name}.csv"}, 9.8127
    for k in (2, 3, 4):
        own = folder / f"getovermassif/session{k}"
        yield f"getovermassif {k}", {"accelerometer_path": f"{own}_acc.txt", "gyroscope_path": f"{own}_gyro.txt"}, 9.803
    yield "thermal_chamber", {"path": folder / "thermal_chamber/imu_raw_data.tsv"}, 9.81
    tag = pl.read_csv(folder / "cats_tag/cats_temperature_2poses.csv.gz").to_dict(as_series=False)
    tag = {name: np.array(v) for name, v in tag.items()}
    yield "cats_tag", {"path": tag}, 9.806
    yield "cats_tag, no temperature", {"path": {k: v for k, v in tag.items() if k != "temp_C"}}, 9.806
    for k in range(1, 6):
        yield f"analog6dof {k}", {"path": folder / f"analog6dof/imuRaw{k}.csv"}, 9.796
    for unit in "ab":
        for k in (1, 2):
            yield f"dual_xsens {unit} {k}", {"path": folder / f"dual_xsens/imu_{unit}_45_{k}.csv"}, 9.81
    for k in (1, 2):
        yield f"adis16405 {k}", {"path": folder / f"adis16405/adis16405_imu{k}.npz"}, 9.81
    yield "galaxy_s5", {"path": folder / "galaxy_s5/samsung_galaxy_s5.csv.gz"}, 9.81
    for axis in "xyz":
        yield f"ctu {axis} rotation", {"path": folder / f"ctu/{axis}_rotation.csv", "rate_hz": 100.0}, 9.81


def calibrated(name, arguments, gravity):
    """One line of a calibration: time with reading, norm residual, cross-validated errors, verdict."""
    began = time.perf_counter()
    try:
        result = trihedron.calibrate(trihedron.read(**arguments), gravity_m_s2=gravity)
    except ValueError as error:
        return f"{name}: error: {error}"
    seconds = time.perf_counter() - began
    quality, gyroscope = result.accelerometer.quality, result.gyroscope
    angles = None if gyroscope is None else gyroscope.quality.held_out_angle_deg
    angle = f"{np.sqrt(np.nanmean(angles**2)):7.3f} °" if angles is not None else "–"
    held = "–" if quality.held_out_rms is None else f"{1e3 * quality.held_out_rms:.2f} mm/s²"
    verdict = "OK" if result.is_trustworthy else "not to be trusted"
    norms = f"{1e3 * quality.rms_dof:5.2f} mm/s² {held:>10s} {1e3 * quality.floor:4.2f} mm/s²"
    return f"{name:26s} {seconds:5.2f} s {result.segments.n_poses:5d} {norms} {angle:>9s}  {verdict}"


def of(arguments, gravity):
    """``(diagnosis or None, one sentence, seconds)``."""
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            d = trihedron.diagnose(trihedron.read(**arguments), gravity_m_s2=gravity)
    except ValueError as error:
        return None, str(error), time.process_time() - start
    return d, "", time.process_time() - start


def as_row(name, d, why, seconds):
    """One line of the table."""
    if d is None:
        return f"| {name} | – | error: {why.split(': ', 1)[-1]} | | | | {seconds:.0f} s |"
    ids, sizes, held = [], [], []
    for e in d.effects:
        also = f" (or {', '.join(e.confounded_with)})" if e.confounded_with else ""
        ids.append(e.id + also)
        sized = [p for p in e.parameters if p.std > 0.0] or list(e.parameters)
        big = max(sized, key=lambda p: (round(abs(p.value) / max(p.std, 1e-300), 3), abs(p.value)), default=None)
        codes = "".join(f", {p.name} {p.value:.9g}" for p in e.parameters if p.name.startswith("raw_"))
        sizes.append("–" if big is None else f"{big.name} {big.value:.3g} ± {big.std:.1g} {big.unit}{codes}")
        h = e.held_out[0] if e.held_out else None
        held.append("–" if h is None else f"{h.domain} {h.chi2_per_dof_before:.2g} → {h.chi2_per_dof_after:.2g}")
    left = ", ".join(f"{t.domain} {t.chi2_per_dof:.2g}" for t in d.remaining if t.disagrees)
    related = "".join(f"; relation: {', '.join(one.depends_on)}" for one in d.relations).replace("|", r"\|")
    named = "; ".join(ids) + related
    return (f"| {name} | {d.segments.n_poses} | {d.verdict}{': ' if named else ''}{named} | {'; '.join(sizes)} "
            f"| {'; '.join(held)} | {left or '–'} | {seconds:.0f} s |")  # fmt: skip


def against_published(folder: Path) -> None:
    """Print the parameters published for the Xsens log beside what is found."""
    name, arguments, gravity = next(recordings(folder))
    result = trihedron.calibrate(trihedron.read(**arguments), gravity_m_s2=gravity, method="separate")
    published = json.loads((folder / f"{name}/published_imu_tk.json").read_text())
    for sensor, key in ((result.accelerometer, "acc"), (result.gyroscope, "gyro")):
        theirs = np.array(published[key]["misalignment"]) @ np.diag(published[key]["scale"])
        # Lengths of columns do not depend on the frame.
        ratio = np.linalg.norm(sensor.S, axis=0) / np.linalg.norm(theirs, axis=0) - 1.0
        print(f"{name} {key} scale: {100 * np.abs(ratio).max():.3f} % from the published one at most")
    bias = -np.linalg.solve(result.accelerometer.S, result.accelerometer.b) - published["acc"]["bias"]
    print(f"{name} accelerometer bias: {np.abs(bias).max():.1f} counts from the published one at most")


def main() -> None:
    what, folder, words = sys.argv[1], Path(sys.argv[2]), sys.argv[3:]
    if what == "diagnose":
        print(
            "| set | poses | verdict: effects in order | parameter | cross-validated, χ² per row | unexplained | CPU |"
        )
        print("|---|---|---|---|---|---|---|")
    else:
        print("recording                     time poses   residual   cross-val.   noise   gravity  verdict")
    for name, arguments, gravity in recordings(folder):
        if words and not any(word in name for word in words):
            continue
        done = as_row(name, *of(arguments, gravity)) if what == "diagnose" else calibrated(name, arguments, gravity)
        print(done, flush=True)
    if what == "calibrate" and not words:
        against_published(folder)


if __name__ == "__main__":
    main()
