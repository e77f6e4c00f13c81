"""Truth to the tool's definitions, and what an answer is worth."""

from __future__ import annotations

from typing import Any

import numpy as np

from desk_trial.flaws import OUTSIDE
from desk_trial.parts import Session, Unit
from desk_trial.sensing import FIRST_TEMPERATURE, SUPPLY_V, drift
from desk_trial.session import Made
from desk_trial.turns import Array
from desk_trial.visibility import SEEN

Result = dict[str, Any]
SCORES = ("right", "shared", "behind another", "silent", "hidden", "wrong", "error")
SENSORS = ("accelerometer", "gyroscope")
NO_PIVOT = "box"
"""It tips over one edge after another; heads and wrists turn about a point of the board's own, a true lever arm."""
STAMPS_OFF = {"ms", "late", "burst"}
ALSO_RIGHT = {
    "accel-gyro-time-offset": {"sensor-lag"}, "sensor-lag": {"accel-gyro-time-offset"},
    "stale-accel": {"sensor-lag", "accel-gyro-time-offset"}, "inl": {"accel-zero-scatter"},
    "popcorn": {"gyro-zero-scatter", "accel-zero-scatter"}, "auto-zero": {"gyro-zero-scatter"},
    "self-heating": {"gyro-hidden-drift", "gyro-zero-scatter"}, "gyro-memory": {"gyro-zero-scatter"},
}  # fmt: skip
"""What the catalogue has for the same thing: not another mechanism."""


def nuisances(s: Session, u: Unit) -> set[str]:
    """Catalogue names of what this session truly has beside its flaw."""
    out = set() if s.style == NO_PIVOT else {"lever-arm"}
    if s.gyro_scatter:
        out.add("gyro-zero-scatter")
    if s.accel_scatter:
        out.add("accel-zero-scatter")
    if s.line:
        out.add("periodic-interference")
    if s.is_bumped or s.creep_deg:
        out.add("disturbed-pose")
    if s.stamps in STAMPS_OFF:
        out.add("timing-jitter")
    for sensor, per_k, blur in (
        ("accel", u.accel_zero_per_k, np.hypot(u.accel_flicker, s.accel_scatter)),
        ("gyro", u.gyro_zero_per_k, np.hypot(u.gyro_flicker, s.gyro_scatter)),
    ):
        # A part that warms drifts; it counts where that is more than its zeros stray anyway.
        if np.abs(per_k).max() * s.warming_k > blur:
            out |= {f"{sensor}-thermal-bias", f"{sensor}-hidden-drift"}
    return out


def sealed(made: Made, per_si: tuple[float, float], truth: dict[str, Array], chi2: dict[str, float]) -> Result:
    """What the trial writes aside: a JSON-able answer."""
    s = made.session
    flaw = {k: np.asarray(v).tolist() if not isinstance(v, str) else v for k, v in made.flaw.items()}
    return {
        "flaw": flaw.get("id", "none"), "size": flaw, "chi2": chi2, "style": s.style, "rate_hz": s.rate_hz,
        "poses": s.poses, "hold_s": s.hold_s, "stamps": made.log.stamp_kind, "layout": s.layout,
        "beside": sorted(nuisances(s, made.unit)), "per_si": list(per_si),
        "truth": {k: v.tolist() for k, v in truth.items()},
    }  # fmt: skip


def _as_referred(answer: Result, references: dict[str, float | None]) -> dict[str, Array]:
    """The truth at the temperature and supply from which the tool counts; a drift by its mean."""
    truth = {k: np.array(v) for k, v in answer["truth"].items()}
    name, size = answer["flaw"], answer["size"]
    sensor = 0 if name.startswith("accel") or name == "supply-sensitivity" else 1
    S, b, unit = truth[f"S_{SENSORS[sensor]}"], truth[f"b_{SENSORS[sensor]}"], answer["per_si"][sensor]
    zero = -np.linalg.solve(S * unit, b)
    at = [v for k, v in references.items() if ("temperature" if "thermal" in name else "supply") in k.lower()]
    if "warming_k" in size and at and at[0] is not None:
        warm = at[0] - FIRST_TEMPERATURE
        if name.endswith("bias"):
            zero = zero + np.array(size["size"]) * warm
        else:
            S = S @ np.diag(1 / (1 + np.array(size["size"]) * warm))
    elif name == "supply-sensitivity" and at and at[0] is not None:
        fall = 1 - at[0] / SUPPLY_V
        S, zero = S / (1 - size["scale"] * fall), zero - np.array(size["offset"]) * fall
    elif "hidden-drift" in name:
        zero = zero + drift(np.linspace(0, 1, 2000), size).mean(0)
    return truth | {f"S_{SENSORS[sensor]}": S, f"b_{SENSORS[sensor]}": -(S * unit) @ zero}


def z_scores(answer: Result, references: dict[str, float | None], model: dict[str, Any]) -> dict[str, list[float]]:
    """``S_accelerometer`` … → (said - true) / said sigma of every number that has one."""
    truth = _as_referred(answer, references)
    out: dict[str, list[float]] = {}
    for sensor in SENSORS:
        said = model.get(sensor)
        if not said:
            continue
        for part in "Sb":
            sigma = np.array(said[f"sigma_{part}"], dtype=float)
            error = np.array(said[part]) - truth[f"{part}_{sensor}"]
            out[f"{part}_{sensor}"] = (error[sigma > 0] / sigma[sigma > 0]).tolist()
    return out


def scored(answer: Result, said: dict[str, Any] | None) -> Result:
    """One of SCORES, with the names that are false; None is an error of the tool."""
    if said is None:
        return {"score": "error", "false": []}
    flaw, effects = answer["flaw"], said["effects"]
    ids = [e["id"] for e in effects]
    also = ALSO_RIGHT.get(flaw, set())
    false = [i for i in ids if i != flaw and i not in also and i not in answer["beside"]]
    named = set(ids).union(*(e["confounded_with"] for e in effects)) if effects else set()
    is_visible = not answer["chi2"] or max(answer["chi2"].values()) > SEEN
    if flaw == "none":
        score = "wrong" if false else "right"
    elif flaw in OUTSIDE:
        is_found = said["verdict"] == "unexplained" or said["laws"] or also & set(ids)
        score = "wrong" if false else "right" if is_found else "silent" if is_visible else "hidden"
    elif ids and ids[0] == flaw:
        score = "right"
    elif ids and (flaw in effects[0]["confounded_with"] or ids[0] in also):
        score = "shared"
    elif flaw in named:
        score = "behind another"
    else:
        score = "wrong" if false else "silent" if is_visible else "hidden"
    return {"score": score, "false": false}
