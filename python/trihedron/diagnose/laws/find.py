"""Laws of what stays unexplained, sensor by sensor, as the record that a diagnosis shows."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.laws.misfit import Judged, Misfit
from trihedron.diagnose.laws.moves import move_misfit
from trihedron.diagnose.laws.poses import Zeros, accel_misfits, gyro_misfits
from trihedron.diagnose.laws.room import RoomLaw, search_room
from trihedron.diagnose.laws.search import Accepted, search
from trihedron.records.diagnosis import EffectParameter, Relation
from trihedron.records.domains import Domain, HeldOut
from trihedron.records.words import law_experiment, law_resembles, words

Sensor = Literal["accelerometer", "gyroscope"]
OUT: dict[Sensor, str] = {"gyroscope": "rad/s", "accelerometer": "m/s^2"}
ZERO_WORD: dict[Sensor, str] = {"gyroscope": "gyro", "accelerometer": "accelerometer"}
ROOM_VECTOR = "vector fixed in the room"
EARTH_RATE_RAD_S = 7.292115e-5
"""WGS 84."""
CLEARER = 5.0
"""Held-out log-likelihood by which a vector fixed in the room must beat all terms of the body: odds of 150 to 1."""


@dataclass(frozen=True, eq=False)
class ZeroLaws:
    """Laws of one sensor's zeros; ``share`` of the held-out sum of squares of all its axes that they remove."""

    laws: tuple[Relation, ...]
    share: float


def find_laws(context: Context, domains: Collection[Domain]) -> tuple[Relation, ...]:
    """Laws of the misfit in ``domains``, the largest share first; empty where nothing predicts."""
    out: list[Relation] = []
    if "static-gyro" in domains:
        out += gyro_zero_laws(context).laws
    if "static-accel" in domains:
        out += accel_zero_laws(context).laws
    if "moves" in domains or "dynamics" in domains:
        out += _motion_laws(context, is_gyro_only="moves" in domains and "dynamics" not in domains)
    return tuple(sorted(out, key=lambda law: -law.share))


@lru_cache(maxsize=4)
def gyro_zero_laws(context: Context) -> ZeroLaws:
    """What the gyros' zeros at rest follow, beyond gravity as the catalogue has it."""
    return _of_zeros(gyro_misfits(context) if context.obs.raw_rate is not None else None)


@lru_cache(maxsize=4)
def accel_zero_laws(context: Context) -> ZeroLaws:
    """What the accelerometers' zeros at rest follow."""
    return _of_zeros(accel_misfits(context))


def _of_zeros(zeros: Zeros | None) -> ZeroLaws:
    if zeros is None:
        return ZeroLaws((), 0.0)
    sensor: Sensor = "gyroscope" if zeros.sensor == "gyroscope" else "accelerometer"
    domain: Domain = "static-gyro" if sensor == "gyroscope" else "static-accel"
    n_tried = sum(len(c) for c in zeros.candidates) + 1
    found = [search(m, list(c), n_tried) for m, c in zip(zeros.misfits, zeros.candidates, strict=True)]
    of_terms = sum(a.judged.gain for a in found if a is not None)
    if sensor == "gyroscope" and zeros.room is not None:
        room = search_room(zeros.misfits, zeros.room, n_tried)
        if room is not None and room.gain > of_terms + CLEARER:
            return ZeroLaws((_room_law(room),), room.share)
    squares = [_squares_before(z) for z in zeros.misfits]
    laws = _laws_of(sensor, domain, [a for a in found if a is not None], sum(squares))
    return ZeroLaws(laws, sum(law.share for law in laws))


def _squares_before(misfit: Misfit) -> float:
    total, _, n = misfit.held_out
    return misfit.variance * total / n


def _laws_of(sensor: Sensor, domain: Domain, found: list[Accepted], before: float) -> tuple[Relation, ...]:
    """One law per family of variables; axes that follow the same family share it."""
    families: dict[str, list[tuple[str, tuple[str, ...], str, np.ndarray, np.ndarray, Judged]]] = {}
    for one in found:
        for term in one.terms:
            if term.candidate.is_known:
                continue
            c = term.candidate
            families.setdefault(c.family, []).append((c.target, c.names, c.unit, term.value, term.sigma, one.judged))
    out = []
    for family, terms in families.items():
        judged = list({id(t[5]): t[5] for t in terms}.values())
        removed = sum(j.held_before - j.held_after for j in judged)
        share = float(np.clip(removed / max(before, 1e-300), 0.0, 1.0))
        coefficients = tuple(
            EffectParameter(f"{target}: {name}", float(v), float(s), _unit_of(sensor, unit, name))
            for target, names, unit, value, sigma, _ in terms
            for name, v, s in zip(names, value, sigma, strict=True)
        )
        depends = tuple(dict.fromkeys(name for _, names, *_ in terms for name in names))
        axes = tuple(dict.fromkeys(t[0] for t in terms))
        said = words(
            "law-follows", sensor=ZERO_WORD[sensor], is_at_rest=domain.startswith("static"), axes=axes, depends=depends,
            share=share,
        )  # fmt: skip
        rms = [float(np.sqrt(sum(getattr(j, side) for j in judged))) for side in ("held_before", "held_after")]
        held = HeldOut(domain, 1.0, (rms[1] / max(rms[0], 1e-300)) ** 2, rms[0], rms[1], _unit_of_misfit(domain))
        out.append(
            Relation(
                sensor, depends, _form(axes, depends), coefficients, share, held, law_resembles(family),
                law_experiment(family), said,
            )
        )  # fmt: skip
    return tuple(out)


def _unit_of_misfit(domain: Domain) -> str:
    return {"static-gyro": "rad/s", "static-accel": "m/s^2"}.get(domain, "sigma")


def _form(axes: tuple[str, ...], depends: tuple[str, ...]) -> str:
    return words("law-form", axes=axes, terms=[f"c{k + 1}·({name})" for k, name in enumerate(depends)])


def _unit_of(sensor: Sensor, unit: str, name: str) -> str:
    if name.endswith("^2") and unit == "K":
        unit = "K^2"
    return OUT[sensor] if unit == "1" else f"({OUT[sensor]})/({unit})"


def _room_law(room: RoomLaw) -> Relation:
    axes = ("x", "y", "z")
    coefficients = [
        EffectParameter(f"{axes[a]}: m_{axes[k]}", float(room.coupling[a, k]), float(room.sigma[a, k]), "rad/s")
        for a in range(3)
        for k in range(3)
    ]
    coefficients.append(
        EffectParameter(words("angle-to-vertical"), room.inclination_deg, room.inclination_sigma_deg, "deg")
    )
    before = sum(j.held_before for j in room.judged)
    after = sum(j.held_after for j in room.judged)
    held = HeldOut("static-gyro", 1.0, after / before, before**0.5, after**0.5, "rad/s")
    family = "earth" if _is_rotation(room) else "room"
    return Relation(
        "gyroscope", (ROOM_VECTOR,), words("law-form-room"),
        tuple(coefficients), room.share, held, law_resembles(family), law_experiment(family),
        words(
            "law-follows-room", inclination_deg=room.inclination_deg, inclination_sigma_deg=room.inclination_sigma_deg,
            share=room.share,
        ),
    )  # fmt: skip


def _is_rotation(room: RoomLaw) -> bool:
    """Whether the coupling is the unit matrix times the Earth's rate, within three standard errors everywhere."""
    for sign in (1.0, -1.0):
        away = (room.coupling - sign * EARTH_RATE_RAD_S * np.eye(3)) / np.maximum(room.sigma, 1e-300)
        if (np.abs(away) < 3.0).all():
            return True
    return False


def _motion_laws(context: Context, *, is_gyro_only: bool) -> list[Relation]:
    motion = move_misfit(context)
    if motion is None:
        return []
    n_tried = len(motion.gyro) + len(motion.accel)
    before = _squares_before(motion.misfit)
    sides: list[tuple[Sensor, Domain, Accepted]] = []
    gyro = search(motion.misfit, list(motion.gyro), n_tried)
    if gyro is not None:
        sides.append(("gyroscope", "moves", gyro))
    accel = None if is_gyro_only else search(motion.misfit, list(motion.accel), n_tried)
    if accel is not None:
        sides.append(("accelerometer", "dynamics", accel))
    if not sides:
        return []
    # One misfit, one sensor: that which predicts more of it.
    sensor, domain, best = max(sides, key=lambda side: side[2].judged.gain)
    return list(_laws_of(sensor, domain, [best], before))
