"""Gravity error of a calibration: ``|S a' + b| - |g|`` of static readings, and its expected size."""

import math

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.quantiles import MAD_TO_SIGMA, median
from trihedron.records import Calibration, Finding, SensorCalibration
from trihedron.sensor_model import correct, norms, other_form

FAR_FROM_GRAVITY = 0.2
"""Relative difference of the corrected |f| at rest from gravity that is no error of a calibration: before one, MEMS
parts are within 10 % of their data sheet."""
OFF_GRAVITY, SIGMAS = 0.01, 5.0
"""Least relative difference that is stated as an error: |g| differs by 0.5 % between places, and the bias of a
consumer part returns within 10 mg; and its least size in standard deviations."""
MORE = 2.0
"""Scatter of |f| over what noise, the calibration's uncertainty and its own gravity error explain, that is another
sensor's or motion; robustly estimated, it is within 20 % of them in a log of the calibration's own sensor."""


def norm_error(
    sensor: SensorCalibration, means: FloatArray, variance: FloatArray, gravity_m_s2: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``|S a' + b| - |g|`` (n,) of mean readings (n, 3), its noise, and its noise with the calibration's uncertainty.

    With ``u = f/|f|``: ``var = uᵀ S Σ Sᵀ u + J C Jᵀ``, ``J = (u ⊗ a', u)``.
    """
    norm, jacobian = norms(means, sensor.S, sensor.b)
    noise = np.sum((jacobian[:, 9:] @ sensor.S) ** 2 * variance, axis=1)
    model = np.einsum("ni,ij,nj->n", jacobian, sensor.covariance, jacobian)
    return norm - gravity_m_s2, np.sqrt(noise), np.sqrt(noise + np.maximum(model, 0.0))


def static_force(calibration: Calibration, norm_m_s2: float, force: FloatArray, noise_m_s2: float) -> Finding:
    """The finding with the corrected |f| of quiet windows: a warning off gravity, serious far from it.

    ``force`` (n, 3) is the mean of each window, with ``noise_m_s2``. Its standard deviation is the scatter of the
    windows, not of their mean: in motion they share an acceleration. More scatter than the calibration's own poses,
    its uncertainty and the noise explain is not that of its sensor.
    """
    sensor, gravity = calibration.accelerometer, calibration.gravity_m_s2
    readings = correct(force, *other_form(sensor.S, sensor.b))
    errors, _, model = norm_error(sensor, readings, np.zeros_like(force), gravity)
    scatter = MAD_TO_SIGMA * median(np.abs(errors - median(errors)))
    sigma = math.hypot(median(model), scatter)
    share = norm_m_s2 / gravity - 1.0
    own = None if sensor.quality is None else sensor.quality.held_out_rms
    expected = math.inf if own is None else math.hypot(median(model), noise_m_s2, own)
    case = "scatter" if scatter > min(OFF_GRAVITY * gravity, MORE * expected) else ""
    if abs(share) > FAR_FROM_GRAVITY:
        case = "far"
    elif abs(share) > OFF_GRAVITY and abs(norm_m_s2 - gravity) > SIGMAS * sigma:
        case = "off"
    return Finding.of(
        "static-force",
        case,
        norm_m_s2=norm_m_s2,
        gravity_m_s2=gravity,
        share=share,
        sigma_m_s2=sigma,
    )
