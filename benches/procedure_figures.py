"""The pictures of docs/procedure.md, made by the tool from simulation: ``python benches/procedure_figures.py``."""

from dataclasses import replace
from pathlib import Path

from trihedron import calibrate
from trihedron.files.output import write_whole
from trihedron.report.body import draw_body_poses
from trihedron.report.figures import draw_poses, draw_signals, png
from trihedron.simulate import hand_session, scenario_by_name, simulate, six_faces
from trihedron.simulate.sessions import EDGES, FACES

FOLDER = Path(__file__).parents[1] / "docs" / "figures"
GRAVITY_M_S2 = 9.80665


def main() -> None:
    """Draw them all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=18, first_hold_s=10.0))
    recording, _ = simulate(scenario, seed=1)
    session = calibrate(recording, gravity_m_s2=GRAVITY_M_S2)
    faces, _ = simulate(replace(scenario, motion=six_faces(2, 4.0, 2.0)), seed=1)
    few = calibrate(faces, gravity_m_s2=GRAVITY_M_S2)
    pictures = {
        "procedure_poses.png": draw_body_poses([*FACES, *EDGES]),
        "procedure_signals.png": draw_signals(recording, session.segments),
        "procedure_sphere.png": draw_poses(session.accelerometer, session.segments.accelerometer_mean),
        "procedure_six_faces.png": draw_poses(few.accelerometer, few.segments.accelerometer_mean),
    }
    for name, picture in pictures.items():
        content = png(picture)
        write_whole(FOLDER / name, content, overwrite=True)
        print(f"{name}: {len(content) // 1000} kB")


if __name__ == "__main__":
    main()
