"""A simulated session of a named part, as short as a diagnosis allows."""

import trihedron
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.named import _of
from trihedron.simulate.profiles import profile_by_name


def simulated(effect_id="", seed=1, n_poses=24, grade="mpu", unit=None, **size):
    """Recording and truth of a hand session with an effect of a stated size, or healthy; ``unit`` None is ``seed``."""
    scenario = _of(profile_by_name(grade), hand_session(n_poses, layout=seed), "session", unit or seed)
    return simulate(with_effect(scenario, effect_id, **size) if effect_id else scenario, seed)


def diagnosed(effect_id="", seed=1, n_poses=24, grade="mpu", **size):
    recording, truth = simulated(effect_id, seed, n_poses, grade, **size)
    return trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2)
