"""The models of a diagnosis: S and b without and with the effects, gravity and noise."""

from __future__ import annotations

from trihedron.arrays import AXES
from trihedron.records.diagnosis import Diagnosis
from trihedron.report.diagnosis_words import (
    size_in_words,
    value_in_words,
)
from trihedron.report.document import Block, Facts, Table
from trihedron.report.numbers import (
    engineering_exponent,
    plain_number,
    power_of_ten,
    unit_in_print,
)


def models_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for name in ("accelerometer", "gyroscope"):
        before, after = getattr(diagnosis.baseline, name), getattr(diagnosis.extended, name)
        if before is None or after is None or before["raw_unit"] == "none":
            continue
        # Without an effect both models are one.
        models = (before, after) if diagnosis.effects else (before,)
        rows = [
            (f"S_{AXES[i]}{AXES[j]}", *(_cell(model, "S", (i, j)) for model in models))
            for i in range(3)
            for j in range(3)
            if before["sigma_S"][i][j] > 0.0
        ]
        rows += [(f"b_{AXES[i]}", *(_cell(model, "b", (i,)) for model in models)) for i in range(3)]
        head = ("", "linear model", "with the effects")[: 1 + len(models)]
        blocks.append(Table(head, tuple(rows), f"{name.capitalize()}, raw in {unit_in_print(before['raw_unit'])}"))
    gravity = getattr(diagnosis, "gravity_source", "")
    facts = [("gravity", f"{diagnosis.gravity_m_s2:.5f} m/s²" + (f", {gravity}" if gravity else ""))]
    for name in ("accelerometer", "gyroscope"):
        density = diagnosis.noise.get(f"{name}_density")
        if density is not None:
            unit = str(diagnosis.noise.get(f"{name}_unit", ""))
            words = ", ".join(plain_number(float(d)) for d in density)
            words += f" {unit_in_print(unit)}"
            corner = diagnosis.noise[f"{name}_corner_s"]
            if corner is not None:
                words += f"; bias random walk beyond {plain_number(float(corner))} s"
            facts.append((f"{name} noise", words))
        hidden = diagnosis.noise.get(f"{name}_bias")
        if hidden:
            unit = "m/s^2" if name == "accelerometer" else "rad/s"
            bound = ", at its upper bound" if hidden["is_at_edge"] else ""
            words = f"changes {size_in_words(hidden['rms'], unit)} RMS between poses (random walk{bound})"
            words += f"; uncertainty of a pose's mean {size_in_words(hidden['noise'], unit)}"
            if "flicker" in hidden:
                words += f", {size_in_words(hidden['flicker'], unit)} of it flicker noise seen inside poses"
            facts.append((f"{name} bias", words))
    blocks.append(Facts(tuple(facts)))
    return tuple(blocks)


def _cell(model: object, key: str, place: tuple[int, ...]) -> str:
    value, sigma = model[key], model["sigma_" + key]  # type: ignore[index]
    for k in place:
        value, sigma = value[k], sigma[k]
    return _number_with_sigma(float(value), float(sigma))


def _number_with_sigma(value: float, sigma: float) -> str:
    exponent = engineering_exponent(max(abs(value), sigma))
    if sigma <= 0.0 or -3 < exponent <= 3:
        return value_in_words(value, sigma)
    scale = 10.0**-exponent
    return f"({value_in_words(scale * value, scale * sigma)}) {power_of_ten(exponent)}"
