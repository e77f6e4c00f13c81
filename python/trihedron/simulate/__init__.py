"""Simulation of an IMU: motion, sensor mechanism, noise, ADC. It produces the same records as reading a log."""

from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.effects import EFFECT_IDS, diagnosed_sizes, effects_of, with_effect
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.steps import Disturb, Motion, MoveTo, Oscillate, Pose, Turn, Vibrate
from trihedron.simulate.noise import NoiseTerms, make_noise
from trihedron.simulate.profiles import profile_by_name
from trihedron.simulate.readout import Drift, Smoother
from trihedron.simulate.run import simulate
from trihedron.simulate.scenario import Clock, Environment, Scenario, Temperature
from trihedron.simulate.scenario_file import list_scenarios, read_scenario, scenario_by_name, scenario_from_table
from trihedron.simulate.sessions import dividing_head, hand_session, long_static, table_turns
from trihedron.simulate.twin import twin_motion, twin_scenario
from trihedron.simulate.twin_noise import low_pass_like, noise_from_poses, noise_of_octaves
