"""Effects that a scenario contains, read from its parameters."""

import math
from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from trihedron.simulate.effects.sizes import mass_response, response
from trihedron.simulate.motion.steps import Disturb, Motion, Pose, Turn
from trihedron.simulate.readout import Electronics, triple
from trihedron.simulate.scenario import Scenario, Temperature


def effects_of(scenario: Scenario) -> MappingProxyType[str, MappingProxyType[str, object]]:
    """Every effect of the catalogue that a scenario contains, with its physical parameters."""
    found: dict[str, dict[str, object]] = {}
    accel, gyro, clock, place = scenario.accelerometer, scenario.gyroscope, scenario.clock, scenario.environment

    def note(effect_id: str, **parameters: object) -> None:
        found.setdefault(effect_id, {}).update(parameters)

    k2, k3 = mass_response(accel.mass)
    # Rounding of the conversion leaves 1e-20 where the coefficient is 0.
    if any(abs(v) > 1e-12 for v in k2):
        note("accel-quadratic", k2=k2)
    if any(abs(v) > 1e-12 for v in k3):
        note("accel-cubic", k3=k3)
    if accel.mass.moves:
        note("sensor-lag", proof_mass=(accel.mass.resonance_hz, accel.mass.quality))
    if gyro.sense_mode.bandwidth_hz:
        note("sensor-lag", sense_mode=(gyro.sense_mode.bandwidth_hz, gyro.sense_mode.quality))
    softer = (accel.mass.spring_per_k, accel.mass.gap_per_k)
    if any(map(any, softer)) and not place.temperature.is_constant_reference:
        # Both reduce the scale; this is their contribution to the linear coefficient.
        note("accel-thermal-scale", mechanism_per_k=tuple(-a - b for a, b in zip(*softer, strict=True)))
    memory = accel.hysteresis
    if any(memory.offset_m_s2) or any(memory.creep_fraction):
        note("accel-hysteresis", **{name: getattr(memory, name) for name in memory.__dataclass_fields__})
    mode = gyro.sense_mode
    if any(mode.deflection_s_rad):
        pairs = [response(mode.deflection_s_rad[k], mode.second[k], mode.third[k]) for k in range(3)]
        note("gyro-scale-nonlinearity", c2=triple([p[0] for p in pairs]), c3=triple([p[1] for p in pairs]))
    if any(any(row) for row in gyro.g_sensitivity):
        note("gyro-g-sensitivity", matrix=gyro.g_sensitivity)
    places = np.asarray(accel.places_m)
    if places.any():
        if np.ptp(places, axis=0).max() == 0.0:
            note("lever-arm", arm_m=accel.places_m[0])
        else:
            note("accel-size-effect", places_m=accel.places_m)
    for prefix, sensor in (("accel", accel), ("gyro", gyro)):
        name = "accelerometer" if prefix == "accel" else "gyroscope"
        _note_electronics(note, prefix, name, sensor.electronics, place.temperature)
        if any(sensor.rectification):
            note("vibration-rectification", **{name: sensor.rectification})
        # Quantisation matters where the noise of one sample does not dither the LSB.
        smear = max(sensor.noise.N) * math.sqrt(clock.rate_hz)
        coarse = 0.5 * sensor.adc.lsb * float(np.linalg.norm(np.asarray(sensor.S), axis=0).max()) > smear
        if sensor.adc.dead_band or sensor.adc.missing_every or (coarse and sensor.adc.lsb > 0.0):
            note("quantisation", **{name: (sensor.adc.lsb, sensor.adc.dead_band, sensor.adc.missing_every)})
        if np.linalg.det(np.asarray(sensor.S)) < 0.0:
            note("axis-handedness", **{name: "left-handed"})
    if clock.gyroscope_offset_s:
        note("accel-gyro-time-offset", offset_s=clock.gyroscope_offset_s)
    if clock.losses or clock.loss_probability:
        note("dropped-samples", probability=clock.loss_probability, restamped=clock.restamped)
        note("dropped-samples", losses=tuple((loss.time_s, loss.n) for loss in clock.losses))
    if clock.jitter_s or clock.rate_error or clock.timestamp_jitter_s:
        note(
            "timing-jitter", jitter_s=clock.jitter_s, rate_error=clock.rate_error, timestamps_s=clock.timestamp_jitter_s
        )
    if place.earth_rate:
        note("earth-rate", latitude_deg=place.latitude_deg, heading_deg=place.heading_deg)
    _note_motion(note, scenario.motion)
    return MappingProxyType({name: MappingProxyType(values) for name, values in found.items()})


def _note_electronics(
    note: Callable[..., None], prefix: str, name: str, electronics: Electronics, temperature: Temperature
) -> None:
    thermal = electronics.thermal
    if not temperature.is_constant_reference:
        for kind in ("bias", "scale"):
            linear, quadratic = getattr(thermal, f"{kind}_per_k"), getattr(thermal, f"{kind}_per_k2")
            if any(linear) or any(quadratic):
                note(f"{prefix}-thermal-{kind}", per_k=linear, per_k2=quadratic, logged=temperature.logged)
    if any(electronics.asymmetry):
        note(f"{prefix}-scale-asymmetry", asymmetry=electronics.asymmetry)
    drift = electronics.drift
    if any(drift.amplitude) or any(drift.change):
        dies = {"amplitude": drift.amplitude, "tau_s": drift.tau_s} if any(drift.amplitude) else {}
        goes_on = {"change": drift.change, "length_s": drift.length_s} if any(drift.change) else {}
        note(f"{prefix}-bias-drift", **dies, **goes_on)
    if any(electronics.bias_repeatability) or any(electronics.bias_in_moves):
        in_moves = {"in_moves": electronics.bias_in_moves} if any(electronics.bias_in_moves) else {}
        note(f"{prefix}-bias-repeatability", sigma=electronics.bias_repeatability, **in_moves)
    if any(math.isfinite(v) for v in electronics.saturation):
        note(f"{prefix}-saturation", limit=electronics.saturation)
    if any(electronics.lag_s) or electronics.filter.cutoff_hz:
        note("sensor-lag", **{name: (electronics.lag_s, electronics.filter.cutoff_hz, electronics.filter.order)})
    for line in electronics.interference:
        note("periodic-interference", **{name: (line.frequency_hz, line.amplitude)})
    if electronics.ratiometric:
        note("supply-sensitivity", **{name: electronics.ratiometric})


def _note_motion(note: Callable[..., None], motion: Motion) -> None:
    if any(motion.table_tilt_deg):
        note("table-tilt", tilt_deg=motion.table_tilt_deg)
    errors = [step.error_deg for step in motion.steps if isinstance(step, Turn)]
    if any(errors):
        note("turn-angle-error", errors_deg=tuple(errors))
    pose, disturbed = -1, []
    for before, step in zip((None, *motion.steps), motion.steps, strict=False):
        if isinstance(step, Pose) and not isinstance(before, Disturb):
            pose += 1
        elif isinstance(step, Disturb):
            disturbed.append(pose)
    if disturbed:
        note("disturbed-pose", poses=tuple(disturbed))
