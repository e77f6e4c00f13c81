"""Simulation of the instrument: motion, mechanism, noise, converter. Produces the same records as reading a file."""

from trihedron.simulate.library import list_scenarios, scenario_by_name
from trihedron.simulate.motion import Disturb, Hold, Motion, MoveTo, Oscillate, Turn, Vibrate
from trihedron.simulate.noise import NoiseTerms, make_noise
from trihedron.simulate.run import simulate
from trihedron.simulate.scenario import Clock, Environment, Scenario
from trihedron.simulate.sensors import Accelerometer, Adc, Gyroscope
from trihedron.simulate.sessions import dividing_head, hand_session, long_rest, six_faces, table_turns

__all__ = [
    "Accelerometer",
    "Adc",
    "Clock",
    "Disturb",
    "Environment",
    "Gyroscope",
    "Hold",
    "Motion",
    "MoveTo",
    "NoiseTerms",
    "Oscillate",
    "Scenario",
    "Turn",
    "Vibrate",
    "dividing_head",
    "hand_session",
    "list_scenarios",
    "long_rest",
    "make_noise",
    "scenario_by_name",
    "simulate",
    "six_faces",
    "table_turns",
]
