"""One session from seed and flaw: its log, and the truth about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from desk_trial.flaws import Flaw, draw_flaw
from desk_trial.motion import motion
from desk_trial.parts import Session, Unit, draw_session, draw_unit
from desk_trial.readout import Log, read_out
from desk_trial.sensing import Body, body, sensed
from desk_trial.turns import DEGREE, Array, stream


@dataclass(frozen=True)
class Made:
    """``healthy`` is the log of the same session and draws without the flaw (the log itself where there is none)."""

    session: Session
    unit: Unit
    flaw: Flaw
    log: Log
    healthy: Log
    body: Body


def drawn(name: str, seed: int) -> tuple[Session, Unit, Flaw]:
    session, unit = draw_session(seed), draw_unit(seed)
    flaw = draw_flaw(name, seed, session, unit) if name != "none" else {}
    if "hidden-drift" in name:
        session = replace(session, logs_temperature=False)
    if "thermal" in name:
        session = replace(session, logs_temperature=True)
    if name == "earth-rate":
        # Only a better gyro than a consumer part's can see it.
        unit = replace(unit, gyro_density=0.001 * DEGREE, gyro_flicker=0.4 / 3600 * DEGREE, gyro_zero_per_k=np.zeros(3))
        session = replace(session, gyro_scatter=0.0, gyro_range_dps=500.0)
    return session, unit, flaw


def make(name: str, seed: int) -> Made:
    """``name`` is a flaw's or none."""
    session, unit, flaw = drawn(name, seed)
    rate = session.rate_hz * (1 + unit.clock_error) * session.oversampling
    moved = motion(session, seed, rate, {})

    def run(what: Flaw) -> tuple[Log, Body]:
        path = motion(session, seed, rate, what) if what.get("id") == "disturbed-pose" else moved
        on = body(path, rate, session, unit, what)
        return read_out(on, sensed(on, what, seed), session, unit, what, seed), on

    healthy, on = run({})
    if not flaw:
        return Made(session, unit, flaw, healthy, healthy, on)
    if name == "gyro-saturation":
        flaw = flaw | {"limit": float(np.abs(healthy.gyro).max() * stream(seed, "lim").uniform(0.45, 0.75))}
    log, on = run(flaw)
    return Made(session, unit, flaw, log, healthy, on)


def lower_frame(made: Made, per_si: tuple[float, float]) -> dict[str, Array]:
    """Truth as ``S raw + b`` in the frame in which the accelerometer's S is lower triangular with a positive diagonal;
    ``per_si``: units of the log's file per m/s² and per rad/s. Time that the log tells wrong scales the rates.
    """
    log, flip = made.log, np.eye(3)[::-1]
    accel, gyro = np.linalg.inv(made.body.accel_matrix), np.linalg.inv(made.body.gyro_matrix) * log.clock_ratio
    # accel = Q L from the QR of the flipped columns.
    Q, R = np.linalg.qr(accel @ flip)
    signs = np.diag(np.sign(np.diag(flip @ R @ flip)))
    U = signs @ (Q @ flip).T
    return {"S_accelerometer": U @ accel / per_si[0], "b_accelerometer": -U @ accel @ log.accel_zero,
            "S_gyroscope": U @ gyro / per_si[1], "b_gyroscope": -U @ gyro @ log.gyro_zero}  # fmt: skip
