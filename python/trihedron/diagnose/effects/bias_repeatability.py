"""Bias that differs from pose to pose."""

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.bias_process import BiasProcess, per_axis_parameters
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words


class GyroBiasRepeatability(BiasProcess):
    """The bias of every axis is drawn anew in every pose, beyond noise and drift."""

    is_spread = True
    id, sensor, walks = "gyro-bias-repeatability", GYRO, False

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        return per_axis_parameters("sigma", size, std, self.unit), self.reported("scatter", sigma=size)


class AccelBiasRepeatability(BiasProcess):
    """Bias drawn anew in every pose, one sigma for all axes: the norm of gravity does not separate the axes."""

    is_spread = True
    id, sensor, walks = "accel-bias-repeatability", ACCELEROMETER, False

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        sigma, error = float((size**2).mean() ** 0.5), float((std**2).mean() ** 0.5)
        return (EffectParameter("sigma", sigma, error, self.unit),), self.reported("scatter", sigma=sigma)
