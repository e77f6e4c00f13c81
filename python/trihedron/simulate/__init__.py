"""Simulation of an IMU: motion, sensor mechanism, noise, ADC. It produces the same records as reading a log."""

from trihedron.simulate.accelerometer import Accelerometer, Hysteresis, ProofMass
from trihedron.simulate.diagnosed import diagnosed_sizes
from trihedron.simulate.effects import EFFECT_IDS, effects_of, with_effect
from trihedron.simulate.gyroscope import Gyroscope, SenseMode
from trihedron.simulate.motion.steps import Disturb, Motion, MoveTo, Oscillate, Pose, Replay, Turn, Vibrate
from trihedron.simulate.named import list_scenarios, scenario_by_name
from trihedron.simulate.noise import NoiseTerms, make_noise
from trihedron.simulate.profiles import PROFILES, Profile, profile_by_name
from trihedron.simulate.readout import Adc, Drift, Electronics, Filter, Interference, Smoother, Thermal
from trihedron.simulate.run import simulate
from trihedron.simulate.scenario import Clock, Environment, Loss, Scenario, Supply, Temperature
from trihedron.simulate.scenario_file import read_scenario, scenario_from_table
from trihedron.simulate.sessions import (
    dividing_head,
    hand_session,
    long_static,
    poses_in_order,
    rate_table,
    six_faces,
    table_turns,
)
from trihedron.simulate.twin import twin_motion, twin_scenario
from trihedron.simulate.twin_noise import low_pass_like, noise_of_octaves

__all__ = [
    "EFFECT_IDS",
    "PROFILES",
    "Accelerometer",
    "Adc",
    "Clock",
    "Disturb",
    "Drift",
    "Electronics",
    "Environment",
    "Filter",
    "Gyroscope",
    "Hysteresis",
    "Interference",
    "Loss",
    "Motion",
    "MoveTo",
    "NoiseTerms",
    "Oscillate",
    "Pose",
    "Profile",
    "ProofMass",
    "Replay",
    "Scenario",
    "SenseMode",
    "Smoother",
    "Supply",
    "Temperature",
    "Thermal",
    "Turn",
    "Vibrate",
    "diagnosed_sizes",
    "dividing_head",
    "effects_of",
    "hand_session",
    "list_scenarios",
    "long_static",
    "low_pass_like",
    "make_noise",
    "noise_of_octaves",
    "poses_in_order",
    "profile_by_name",
    "rate_table",
    "read_scenario",
    "scenario_by_name",
    "scenario_from_table",
    "simulate",
    "six_faces",
    "table_turns",
    "twin_motion",
    "twin_scenario",
    "with_effect",
]
