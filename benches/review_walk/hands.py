"""Deliverables 1 to 4, 7 and 8: sessions whose calibration is asked, and how many standard errors it is wrong."""

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from review_walk.body import FACES, G, by_hand, on_table
from review_walk.sensor import Part, read_out, score, write

DEG = np.pi / 180.0


def faces(angle, is_stated=True, part=None, rate_hz=100.0, **table):
    """Faces turned there and back by an angle, stated or not."""

    def make(rng):
        motion = on_table(rng, (angle, -angle), **{"tilt_deg": rng.uniform(0.0, 1.5), **table})
        fast = table.get("rate_deg_s", 60.0) > 300.0
        said = {"turns_deg": motion.turns} if is_stated else {}
        p = {"gyro_range": (2000.0 if fast else 500.0) * DEG, **(part or {})}
        return motion, Part(**p), rate_hz, {"method": "faces", **said}

    return make


def hands(rate_hz=100.0, part=None, lost=0.0, is_remade=True, asked=None, **motion):
    """Poses by hand."""

    def make(rng):
        brisk = motion.get("move_s", 2.0) < 1.0
        p = {"gyro_range": (2000.0 if brisk else 500.0) * DEG, **(part or {})}
        return by_hand(rng, **motion), Part(**p), rate_hz, {**(asked or {}), "lost": lost, "is_remade": is_remade}

    return make


def table(rate_deg_s, **more):
    """Nine sides put on a table that leans and turned there: calibrated by moves, no angle said."""

    def make(rng):
        motion = on_table(rng, (180.0, -180.0), rate_deg_s=rate_deg_s, **more)
        return motion, Part(gyro_range=(2000.0 if rate_deg_s > 300.0 else 500.0) * DEG), 100.0, {}

    return make


# The unit of METHODS 9: columns of mirrored axes, counts of a 10-bit converter, 50 Hz.
MIRRORED = {"accel_axes": ((-1, 0, 0), (0, 1, 0), (0, 0, 1)), "gyro_axes": ((-1, 0, 0), (0, 1, 0), (0, 0, 1))}


def manual(is_stated=True, **more):
    """Eighteen poses by hand, then four whole turns there and back on three sides that are not parallel."""

    def make(rng):
        motion = by_hand(rng, 18)
        turned = on_table(rng, (1440.0, -1440.0), rate_deg_s=150.0, tilt_deg=0.7, ups=[FACES[k] for k in (0, 1, 2)])
        first = turned.pieces[0][2](np.zeros(1))[0]
        motion.move(first, 2.0, lambda u: u**3 * (10 - 15 * u + 6 * u * u), rng)
        shift = motion.at
        motion.pieces += [(at + shift, s, pose, place) for at, s, pose, place in turned.pieces]
        motion.holds += [(a + shift, b + shift) for a, b in turned.holds]
        motion.at += turned.at
        said = {"turns_deg": turned.turns} if is_stated else {}
        noise = {"gyro_white": 0.02 * DEG, "accel_white": 3e-3}
        return motion, Part(**{**MIRRORED, **noise, "gyro_bits": 10, "accel_bits": 10, **more}), 50.0, said

    return make


GROUPS = {
    "1": {
        **{
            f"faces, turns of {a:g} {'stated' if s else 'unstated'}": faces(a, s)
            for s in (True, False)
            for a in (90.0, 180.0, 360.0)
        },
        **{f"faces, 180 stated, gyro of {b} bit": faces(180.0, part={"gyro_bits": b}) for b in (8, 10, 12)},
        **{
            f"faces, 180 stated, both of {b} bit": faces(180.0, part={"gyro_bits": b, "accel_bits": b})
            for b in (10, 12)
        },
        "faces, turns of 720 stated": faces(720.0, rate_deg_s=120.0),
        "faces, 360 stated, tilt 3": faces(360.0, tilt_deg=3.0),
        "faces, 180 stated, tilt 3": faces(180.0, tilt_deg=3.0),
        "faces, 180 unstated, tilt 3": faces(180.0, False, tilt_deg=3.0),
    },
    "2": {
        **{f"moves of {s:g} s": hands(move_s=s) for s in (0.25, 1.0, 5.0, 15.0, 30.0, 60.0)},
        **{f"table turns of {r:g} deg/s": table(r) for r in (0.5, 1.0, 2.0, 5.0, 10.0, 50.0, 500.0)},
    },
    "3": {
        "gyro of 8 bit": hands(part={"gyro_bits": 8, "gyro_range": 512.0 * DEG}),
        "gyro of 10 bit": hands(part={"gyro_bits": 10}),
        "3 % lost, stamps remade": hands(lost=0.03),
        "1 % lost, stamps remade": hands(lost=0.01),
        "3 % lost, remade, moves of 10 s": hands(lost=0.03, move_s=10.0),
        "3 % lost, stamps true": hands(lost=0.03, is_remade=False),
    },
    "4": {
        "healthy, 100 Hz": hands(),
        "healthy, 200 Hz, moves of 0.3 to 0.6 s": hands(rate_hz=200.0, move_s=0.45),
        "healthy, 12 poses": hands(poses=12),
        "healthy, 50 Hz, 12 bit": hands(rate_hz=50.0, part={"gyro_bits": 12, "accel_bits": 12}),
    },
    "8": {"the manual's session, stated turns": manual(), "the same by moves": manual(False)},
}


def one(make, seed):
    """A row: what was answered, its codes, its scores."""
    import trihedron

    rng = np.random.default_rng([2026, seed])
    motion, part, rate_hz, asked = make(rng)
    asked = dict(asked)
    lost, is_remade = asked.pop("lost", 0.0), asked.pop("is_remade", True)
    t, a, w, truth = read_out(motion, part, rate_hz, rng)
    if lost:
        kept = rng.random(len(t)) >= lost
        t, a, w = (np.arange(kept.sum()) / rate_hz if is_remade else t[kept]), a[kept], w[kept]
    signs = np.diag(np.array(part.accel_axes))
    signs = signs if signs.all() else np.ones(3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write(path, t, a, w)
        try:
            result = trihedron.calibrate(
                path, gravity_m_s2=G, axis_signs=[int(s) for s in signs] if (signs < 0).any() else None, **asked
            )
        except ValueError as error:
            return {"answer": "refused", "codes": [str(error)[:90]]}
    codes = [f.code.value for f in result.findings if f.severity.value != "note"]
    row = {"codes": codes, "holds": result.segments.n_holds == len(motion.holds)}
    row["answer"] = ("trusted" if result.is_trustworthy else "marked") if result.gyroscope is not None else "no gyro"
    return row | score(result, truth, asked.get("method") == "faces", signs)


def table_line(name, rows):
    """What came of the sessions of one setting."""
    answers = Counter(r["answer"] for r in rows)
    line = f"{name:42s} {', '.join(f'{n} {a}' for a, n in sorted(answers.items())):28s}"
    line += f" holds {sum(r.get('holds', False) for r in rows)}/{len(rows)}"
    good = [r for r in rows if r["answer"] == "trusted"]
    for key in ("S_f", "b_f", "S_w", "b_w"):
        if good:
            z = np.abs(np.concatenate([r[key] for r in good]))
            line += f" | {key} {100 * np.mean(z < 1.96):5.1f} % {np.sqrt(np.mean(z * z)):5.2f} {z.max():5.1f} σ"
    if good:
        line += f" | off {100 * max(r['error'] for r in good):.3f} %"
    return line + "  " + str(dict(Counter(c for r in rows for c in r["codes"])))


def run(group, sessions, first, only=""):
    """Print a line for each setting of a group."""
    for name, make in GROUPS[group].items():
        if only in name:
            print(table_line(name, [one(make, first + k) for k in range(sessions)]), flush=True)
