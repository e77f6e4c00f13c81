"""What the diagnosis says of every public set of recordings, causes withheld: the table of docs/diagnosis-real.md.

python benches/diagnose_recordings.py /path/to/data [word of a set ...]            # in words, with held-out figures
python benches/diagnose_recordings.py /path/to/data --table                        # the table
"""

from __future__ import annotations

import argparse
import os
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
        yield f"mimu4444 exp {k}", {"path": folder / f"mimu4444/exp_{k}.npz", "device": 1}, 9.8184
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


def in_words(name, d, why, seconds):
    """Everything that was said, with held-out figures."""
    if d is None:
        print(f"\n{name}: refused ({seconds:.1f} s): {why}", flush=True)
        return
    n = d.segments.n_holds
    print(f"\n{name}: {n} poses, {d.verdict} ({seconds:.1f} s CPU)")
    for t in d.domains:
        flag = "disagrees" if t.disagrees else ""
        print(f"    {t.domain:14s} chi2/dof {t.chi2_per_dof:9.2f}  {flag} {t.rms:.3g} {t.unit}")
    for e in d.effects:
        print(f"  {e.id}  share {e.share:.2f}  p {e.p_adjusted:.1g}  confounded {list(e.confounded_with)}")
        print(f"    {e.statement}")
        print("    " + ", ".join(f"{p.name} {p.value:.3g} ± {p.std:.1g} {p.unit}" for p in e.parameters[:9]))
        for h in e.held_out[:4]:
            print(f"    held out {h.domain:14s} chi2/dof {h.chi2_per_dof_before:8.2f} -> {h.chi2_per_dof_after:8.2f}"
                  f"   rms {h.rms_before:.4g} -> {h.rms_after:.4g} {h.unit}")  # fmt: skip
    for law in d.laws:
        print(f"  law: {law.statement}")
    print("  remains: " + ", ".join(f"{t.domain} {t.chi2_per_dof:.1f}" for t in d.remaining if t.disagrees), flush=True)
    for f in d.findings:
        print(f"  {f.severity.value}: {f.seen}")


def as_row(name, d, why, seconds):
    """One line of the table."""
    if d is None:
        return f"| {name} | – | refused: {why.split(': ', 1)[-1]} | | | {seconds:.0f} s |"
    ids, sizes, held = [], [], []
    for e in d.effects:
        also = f" (or {', '.join(e.confounded_with)})" if e.confounded_with else ""
        ids.append(e.id + also)
        told = [p for p in e.parameters if p.std > 0.0] or list(e.parameters)
        big = max(told, key=lambda p: abs(p.value) / max(p.std, 1e-300), default=None)
        codes = "".join(f", {p.name} {p.value:.9g}" for p in e.parameters if p.name.startswith("raw_"))
        sizes.append("–" if big is None else f"{big.name} {big.value:.3g} ± {big.std:.1g} {big.unit}{codes}")
        h = e.held_out[0] if e.held_out else None
        held.append("–" if h is None else f"{h.domain} {h.chi2_per_dof_before:.2g} → {h.chi2_per_dof_after:.2g}")
    left = ", ".join(f"{t.domain} {t.chi2_per_dof:.2g}" for t in d.remaining if t.disagrees)
    laws = "".join(f"; law: {', '.join(law.depends_on)}" for law in d.laws)
    told = "; ".join(ids) + laws
    return (f"| {name} | {d.segments.n_holds} | {d.verdict}{': ' if told else ''}{told} | {'; '.join(sizes)} "
            f"| {'; '.join(held)} | {left or '–'} | {seconds:.0f} s |")  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("wanted", nargs="*")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_intermixed_args()
    if options.table:
        print("| set | poses | verdict: effects in order | parameter | held out, χ² per row | remains | CPU |")
        print("|---|---|---|---|---|---|---|")
    for name, arguments, gravity in recordings(options.folder):
        if options.wanted and not any(w in name for w in options.wanted):
            continue
        said = of(arguments, gravity)
        if options.table:
            print(as_row(name, *said), flush=True)
        else:
            in_words(name, *said)


if __name__ == "__main__":
    main()
