"""Signatures of the compiled core. A test compares this stub with the runtime."""

import numpy as np
import numpy.typing as npt

from trihedron.records.calibration import FloatArray

# rotation
def rotation_from_vector(vectors: FloatArray) -> FloatArray: ...
def vector_from_rotation(rotations: FloatArray) -> FloatArray: ...

# poisson
def integrate_moves(
    time_s: FloatArray,
    gyroscope: FloatArray,
    moves: npt.NDArray[np.int64],
    anchors_s: FloatArray,
    scale: FloatArray,
    bias_before: FloatArray,
    bias_after: FloatArray,
    rate_degree: int,
    noise_density: FloatArray,
    sigma_time_s: float,
    nominal_step_s: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
def integrate_raw_rate(
    time_s: FloatArray,
    gyroscope: FloatArray,
    moves: npt.NDArray[np.int64],
    rate_degree: int,
) -> tuple[FloatArray, list[float]]: ...
# simulate
def simulate_motion(
    segments: FloatArray,
    wobble: FloatArray,
    shake: FloatArray,
    time_s: FloatArray,
    gravity_m_s2: float,
    earth_rate_rad_s: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...
