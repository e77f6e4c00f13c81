"""The first screen of every kind of page, photographed for docs/reports.md, and how large the pages are; single figures
for docs/procedure.md, docs/simulation.md and, of the public recordings in FOLDER (not part of the repository), for
docs/evidence.md.

    python benches/pages.py [FOLDER]

All else is simulated with fixed seeds; needs Chromium and the extra ``test``. Two minutes.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright
from scipy.spatial.transform import Rotation

from trihedron.cli import main
from trihedron.files.log import write_recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
GRAVITY = ("--gravity", "9.80665")
VIEWS = ((1280, 860, "light"), (390, 844, "dark"))
ALLAN = ("allan", "--accel-lsb", "0.061 mg", "--gyro-lsb", "0.00763 deg/s")
TRACKED_HZ = 100.0
ON_A_PHONE = ("calibrate", "diagnose")
"""Pages that are also shown as a phone in the dark shows them."""


def logs(folder: Path) -> list[str]:
    """Three sessions of one unit, and a static hour."""
    made = []
    for name, n_poses, seed in (("monday", 24, 3), ("tuesday", 18, 9), ("friday", 18, 12)):
        motion = hand_session(n_poses=n_poses, pose_s=3.0, move_s=2.5, first_pose_s=5.0)
        path = folder / name / "log.csv"
        path.parent.mkdir()
        write_recording(simulate(replace(scenario_by_name("hand-session"), motion=motion), seed)[0], path)
        made.append(str(path))
    main(["simulate", "static-hour", "--seed", "2", "-o", str(folder / "static.npz")])
    return made


def beside_a_tracker(folder: Path, gain: float, shaken: float) -> tuple[str, str]:
    """A log of a body that rocks for two minutes, and a tracker whose world frame drifts by a tenth of a degree.

    Its noise is that of the static hour; ``gain`` is the gyro's, ``shaken`` the noise that vibration adds in
    motion, as a part of the angular rate.
    """
    rng = np.random.default_rng(7)
    time = np.arange(0.0, 120.0, 1.0 / TRACKED_HZ)
    gate = np.clip(np.minimum(time - 5.0, 115.0 - time) / 2.0, 0.0, 1.0)
    angles = [gate * sum(np.sin(2 * np.pi * f * time + p) for f, p in rng.uniform(0.05, 0.6, (4, 2))) for _ in range(3)]
    attitude = Rotation.from_euler("ZYX", 0.5 * np.column_stack(angles))
    rate = np.zeros((len(time), 3))
    rate[1:-1] = (attitude[:-2].inv() * attitude[2:]).as_rotvec() * TRACKED_HZ / 2.0
    force = attitude.inv().apply([0.0, 0.0, 9.80665])
    fast = np.linalg.norm(rate, axis=1)[:, None]
    gyro = rate * gain + 0.004 + (8.75e-4 + shaken * fast) * rng.normal(size=rate.shape)
    accelerometer = force * 1.005 + 0.1 + 0.04 * rng.normal(size=force.shape)
    drift = np.radians(0.1) * np.column_stack([np.sin(time / 5.0), np.cos(time / 7.0), 0.0 * time])
    mounted = Rotation.from_rotvec([0.02, -0.03, 0.05])
    seen = (Rotation.from_rotvec(drift) * attitude * mounted).as_quat()[:, [3, 0, 1, 2]]
    folder.mkdir()
    names = (folder / "rocked.csv", folder / "tracker.csv")
    log = "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]"
    np.savetxt(names[0], np.column_stack([time, accelerometer, gyro]), "%.7g", ",", header=log, comments="")
    np.savetxt(names[1], np.column_stack([time, seen]), "%.9g", ",", header="t [s],qw,qx,qy,qz", comments="")
    return str(names[0]), str(names[1])


def pages(folder: Path) -> dict[str, Path]:
    """A page of every kind by name."""
    first, *others = logs(folder)
    main(["demo", str(folder / "demo"), "--seed", "3"])
    lines = {
        "calibrate": ["calibrate", first, *GRAVITY],
        "many-recordings": ["calibrate", first, *others, *GRAVITY],
        "plan": ["plan"],
        "allan": [*ALLAN, str(folder / "static.npz"), "--json", str(folder / "allan.json")],
        "kalman": ["kalman", first, *GRAVITY],
    }
    found = {"diagnose": folder / "demo" / "disagreement.html", "verify": folder / "demo" / "verification.html"}
    for name, line in lines.items():
        found[name] = folder / f"{name}.html"
        main([*line, "--report", str(found[name])])
    log, truth = beside_a_tracker(folder / "raw", 1.01, 0.0)
    found["reference"] = folder / "reference.html"
    main(["diagnose", log, "--reference", truth, *GRAVITY, "--report", str(found["reference"])])
    found["noise"] = folder / "noise.html"
    log, truth = beside_a_tracker(folder / "flown", 1.0002, 0.01)
    rest = ["--static", str(folder / "allan.json")]
    main(["noise", log, "--reference", truth, *rest, *GRAVITY, "--report", str(found["noise"])])
    main(["fleet", str(folder / "*" / "log.csv"), "-o", str(folder / "fleet"), "--workers", "0", *GRAVITY])
    return {**found, "fleet": folder / "fleet" / "fleet.html"}


def figures(folder: Path, recordings: Path | None) -> dict[str, tuple[Path, str]]:
    """Pages and ids of single figures by name: of a session of 18 poses, of six faces, of recordings."""
    main(["simulate", "six-faces", "-o", "six-faces.csv", "--seed", "1"])
    asked = {
        "procedure_signals": (["tuesday/log.csv", *GRAVITY], "signals"),
        "procedure_sphere": (["tuesday/log.csv", *GRAVITY], "poses"),
        "procedure_six_faces": (["six-faces.csv", *GRAVITY], "poses"),
    }
    if recordings is not None:
        xsens, phone = recordings / "xsens_mti", str(recordings / "phone" / "rec_3_gyro_dynamic__")
        pair = [
            "--accel",
            str(xsens / "xsens_acc.txt"),
            "--gyro",
            str(xsens / "xsens_gyro.txt"),
            "--gravity",
            "9.81744",
        ]
        both = ["--accel", phone + "Acceleration.csv", "--gyro", phone + "AngularVelocity.csv", "--gravity", "9.7974"]
        array = [str(recordings / "mimu4444" / "exp_3.npz"), "--instance", "1", "--gravity", "9.8184"]
        unit = [str(recordings / "mpu9150" / "imu0.log"), "--rate", "100", "--gravity", "9.8"]
        asked |= {
            "gallery_xsens_mti_residuals": (pair, "residuals"),
            "gallery_xsens_mti_moves": (pair, "moves"),
            "gallery_mpu9150_residuals": (unit, "residuals"),
            "gallery_phone_residuals": (both, "residuals"),
            "gallery_mimu4444_moves": (array, "moves"),
        }
    found = {}
    for name, (words, figure) in asked.items():
        path = folder / f"{name}.html"
        main(["calibrate", *words, "--report", str(path)])
        found[name] = (path, figure)
    for scenario in ("manual-example", "table-turns"):
        path = folder / f"{scenario}.html"
        main(["simulate", scenario, "-o", f"{scenario}.csv", "--seed", "1", "--report", str(path)])
        found[f"simulation_{scenario}"] = (path, "signals")
    return found


def photograph(found: dict[str, Path], parts: dict[str, tuple[Path, str]]) -> None:
    """Shots into docs/figures, sizes to stdout."""
    chromium = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
    with sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, path in found.items():
            for width, height, scheme in VIEWS if name in ON_A_PHONE else VIEWS[:1]:
                view = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
                view.goto(path.resolve().as_uri())
                view.screenshot(path=FIGURES / f"page_{name}{'' if scheme == 'light' else '_phone'}.png")
                view.close()
            print(f"{name:16s}{path.stat().st_size / 1000:6.0f} kB")
        view = browser.new_page(viewport={"width": 900, "height": 860})
        for name, (path, figure) in parts.items():
            view.goto(path.resolve().as_uri())
            view.add_style_tag(content=".tools { visibility: hidden }")
            view.locator(f"#{figure}").screenshot(path=FIGURES / f"{name}.png")
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folder", nargs="?", type=lambda given: Path(given).resolve(), metavar="FOLDER", help="the public recordings"
    )
    given = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as place:
        # Names in the pages are those of a working folder.
        os.chdir(place)
        photograph(pages(Path()), figures(Path(), given))
