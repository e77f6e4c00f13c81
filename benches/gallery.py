"""Figures of docs/evidence.md: ``python benches/gallery.py FOLDER`` (the recordings are not part of the repository).

Results only: residuals of poses and moves, nothing of the readings themselves.
"""

import sys
from pathlib import Path

import trihedron
from recordings import sessions

OUTPUT = Path(__file__).parents[1] / "docs" / "figures"
SHOWN = {
    "xsens_mti": ("residuals", "moves"),
    "mpu9150 imu0": ("residuals",),
    "phone rec_3": ("residuals",),
    "mimu4444 exp_3, device 1": ("moves",),
}


def main(folder: Path) -> None:
    """Calibrate and draw them."""
    for name, figures in SHOWN.items():
        arguments, gravity = sessions(folder)[name]
        result = trihedron.calibrate(trihedron.read(**arguments), gravity_m_s2=gravity)
        for figure in figures:
            path = OUTPUT / f"gallery_{name.split()[0]}_{figure}.png"
            result.plot(figure).savefig(path)
            print(f"{path.name}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
