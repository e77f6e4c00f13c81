"""A user's scenario, simulated with a recording's motion, compared with it, and rewritten to match it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.comparison.driving import SCATTER, MovedAlike, bias_scatter, flicker_of_poses
from trihedron.comparison.fitted import model_of_diagnosis
from trihedron.comparison.frames import AIMED_AT
from trihedron.comparison.noise import Sampled, sampled
from trihedron.comparison.quantisation import white_and_quantisation
from trihedron.comparison.ranges import SENSOR
from trihedron.documents import parse_toml
from trihedron.files.scenario import improved_scenario
from trihedron.records.results import DiagnosisResult
from trihedron.simulate import Drift, Scenario, diagnosed_sizes, noise_from_poses, read_scenario, scenario_from_table


@dataclass(frozen=True)
class Improvement:
    """The text of an improved scenario, and effects that it cannot represent, each with the reason.

    ``unlike``: ratio of rms errors, improved scenario over recording, of ``poses`` (gravity error in static poses) and
    ``moves`` (tilt error after rotations), where outside ``AIMED_AT``.
    """

    text: str
    left_out: Mapping[str, str]
    unlike: Mapping[str, float] = field(default_factory=dict)


def improve(scenario: str | Path, found: DiagnosisResult) -> Improvement:
    """The user's scenario file with parameters, noise, sampling and effects of the recording.

    Only entries that differ are replaced, with their comment; all else stays. Effects that only the scenario has are
    removed.

    Raises ``InputError`` when the file is no scenario, or the diagnosis was not made against one.
    """
    given = read_scenario(scenario)
    tables: dict[str, dict[str, Any]] = {"accelerometer": {}, "gyroscope": {}, "clock": {}, "environment": {}}
    _numbers(tables, given, found)
    # Smaller differences are below the last printed digit of a latitude.
    if abs(given.environment.gravity - found.gravity_m_s2) > 1e-4:
        tables["environment"]["gravity_m_s2"] = found.gravity_m_s2
    _noise(tables, given, found)
    ranged = _ranges(tables, given, found)
    physics = [effect for effect in found.effects if effect.side == "recording" and effect.id not in ranged]
    differing = {p.id for p in found.parameters if p.significant} - ranged
    # Effects of both sides whose parameters differ get the recording's values.
    shared = [effect for effect in found.own_effects if effect.id in differing]
    sizes, left_out = diagnosed_sizes([e.to_dict() for e in (*physics, *shared)], float(np.ptp(found.recording.time_s)))
    surplus = [*(effect.id for effect in found.effects if effect.side == "model"), *ranged]
    text = improved_scenario(scenario, tables, sizes, surplus)
    own = found.updated
    if own is not None and own.gyroscope is not None:
        beside = MovedAlike(found.recording, found.segments, own)
        # First flicker that octaves show and poses do not. Then poses before moves: an accelerometer bias in a pose
        # also tilts the gravity by which moves are judged.
        found_by = [("accelerometer", "noise", "B", flicker_of_poses)]
        found_by += [(s, "electronics", key, partial(bias_scatter, sensor=s)) for s, (key, _) in SCATTER.items()]
        for sensor, table, key, of in found_by:
            found_value = of(scenario_from_table(parse_toml(text)), beside)
            if found_value is not None:
                tables[sensor].setdefault(table, {})[key] = list(found_value)
                text = improved_scenario(scenario, tables, sizes, surplus)
        return Improvement(text, left_out, _unlike(scenario_from_table(parse_toml(text)), beside))
    return Improvement(text, left_out)


def _unlike(better: Scenario, beside: MovedAlike) -> dict[str, float]:
    """Ratio of rms pose and move errors, scenario over recording, where outside ``AIMED_AT``."""
    both = zip(("poses", "moves"), beside.missed(better), (beside.poses, beside.moves), strict=True)
    ratios = {key: math.sqrt(made / seen) for key, made, seen in both if made is not None and seen}
    return {key: ratio for key, ratio in ratios.items() if not AIMED_AT[0] <= ratio <= AIMED_AT[1]}


def white_and_quantisation_of(seen: Sampled, name: str) -> dict[str, list[float]]:
    """N and Q of all axes of a sensor from one fit to its octaves; empty where some axis does not determine them."""
    axes = [white_and_quantisation(axis) for sensor, each in seen.noise.items() if sensor == name for axis in each]
    known = [one for one in axes if one is not None]
    if len(known) < len(axes):
        return {}
    return {
        "N": [math.sqrt(one.white) for one in known],
        "Q": [math.sqrt(one.quantisation) if one.is_shown else 0.0 for one in known],
    }


def _numbers(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    moved = {p.id for p in found.parameters if p.significant} | {effect.id for effect in found.effects}
    fits = (("accelerometer", "accel", found.extended.accelerometer), ("gyroscope", "gyro", found.extended.gyroscope))
    for name, prefix, fit in fits:
        groups = {f"{prefix}-bias", f"{prefix}-scale", f"{prefix}-misalignment", "triad-alignment", "axis-handedness"}
        # S and b of both sensors are in one frame, so that they are replaced together.
        scaled = {n.sensor for n in found.noise_compared if n.term in ("range", "unit") and n.significant}
        if fit is None or not (moved & (groups | {"accel-misalignment", "gravity"}) or scaled):
            continue
        b = np.array(fit["b"]) + _mean_drift(found, f"{prefix}-bias-drift")
        tables[name] |= {"S": np.array(fit["S"]), "b": b, "unit": str(fit["raw_unit"])}
        readings = getattr(found.recording, name)
        if readings is not None and getattr(given, name).unit.value != fit["raw_unit"]:
            # Raw readings are in another unit: the recording's LSB replaces the scenario's.
            tables[name]["adc"] = {"lsb": found.recording.facts.of(name).common_step}


def _mean_drift(found: DiagnosisResult, effect_id: str) -> FloatArray:
    """Mean over the poses (3,) of a simulated drift, SI: b of a diagnosis is a mean, that of a scenario is without."""
    effects = [effect.to_dict() for effect in found.own_effects if effect.id == effect_id]
    sizes, _ = diagnosed_sizes(effects, float(np.ptp(found.recording.time_s)))
    since_s = found.segments.time_mid_s - found.recording.time_s[0]
    drifts = [np.average(Drift(**size).at(since_s), axis=0, weights=found.segments.duration_s) for _, size in sizes]
    return np.asarray(sum(drifts, np.zeros(3)))


def _ranges(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> set[str]:
    """Write the exact range limits of the recording's ADCs; returns the ids of effects that these replace.

    Limits that are not of a common ADC stay an effect.
    """
    out = set()
    for effect, name in SENSOR.items():
        readings = getattr(found.recording, name)
        if readings is None:
            continue
        unit = str(tables[name].get("unit", getattr(given, name).unit.value))
        ends = found.recording.facts.of(name).adc_range(readings)
        if ends is None or unit != getattr(found.recording, f"{name}_unit").value:
            continue
        low, high = ends
        out.add(effect)
        adc = getattr(given, name).adc
        if (adc.low, adc.high) != (low, high):
            tables[name].setdefault("adc", {}).update(low=low, high=high)
    return out


def _noise(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    seen = sampled(found.recording, found.segments.poses, model_of_diagnosis(found))
    poses = {str(sensor): noise_from_poses(axes) for sensor, axes in seen.noise.items()}
    for name in ("accelerometer", "gyroscope"):
        differing = [n for n in found.noise_compared if n.significant and n.sensor == name]
        terms: dict[str, list[float]] = {}
        had = getattr(given, name).noise
        for n in differing:
            if n.term in ("N", "B", "K", "Q") and n.recording is not None:
                values = terms.setdefault(n.term, [float(v) for v in getattr(had, n.term)])
                for axis in range(3) if not n.axis else [AXES.index(n.axis)]:
                    values[axis] = n.recording
            elif n.term == "resolution" and n.recording is not None:
                tables[name].setdefault("adc", {})["lsb"] = n.recording
        # A scenario without noise gets the recording's, whether or not the comparison of noise has a result.
        own = poses.get(name)
        if own is not None and (not any(had.N) or any(n.term in ("octave", "bandwidth") for n in differing)):
            noise, low_pass = own
            terms["N"] = list(noise.N)
            if low_pass.corner_hz > 0.0:
                tables[name]["noise_filter"] = {"corner_hz": low_pass.corner_hz, "order": low_pass.order}
            elif getattr(given, name).noise_filter.corner_hz > 0.0:
                tables[name]["noise_filter"] = {"corner_hz": 0.0}
            if "B" not in terms and any(noise.B):
                terms["B"] = list(noise.B)
        if "Q" in terms:
            # N from neighbouring samples includes quantisation noise: N and Q are from one fit, without a low-pass.
            both = white_and_quantisation_of(seen, name)
            if both:
                terms |= both
                tables[name].pop("noise_filter", None)
        if terms:
            tables[name]["noise"] = terms
    for n in found.noise_compared:
        if n.significant and n.term == "rate" and n.recording is not None:
            tables["clock"]["rate_hz"] = n.recording
        elif n.significant and n.term == "jitter" and n.recording is not None:
            tables["clock"] |= {"timestamp_jitter_s": n.recording, "jitter_s": 0.0}
