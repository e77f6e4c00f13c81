"""Tails and quantiles of the distributions that tests are judged by; names and arguments as in ``scipy.special``.

They are made by the core, so that a calibration need not load SciPy, which takes longer than the calibration.
"""

from __future__ import annotations

from trihedron import _core


def chdtrc(dof: float, value: float) -> float:
    """Probability that a chi-square variate exceeds ``value``."""
    return _core.chi_square_above(value, dof)


def chdtri(dof: float, above: float) -> float:
    """Value that a chi-square variate exceeds with probability ``above``."""
    return _core.chi_square_upper(above, dof)


MEDIAN_CHI2 = {dof: chdtri(dof, 0.5) for dof in (1, 2)}
"""Median of a chi-square variate, for robust scales of one number and of a pair."""


def fdtrc(top: float, bottom: float, value: float) -> float:
    """Probability that an F variate exceeds ``value``."""
    return _core.f_above(value, top, bottom)


def fdtri(top: float, bottom: float, below: float) -> float:
    """Value that an F variate stays below with probability ``below``."""
    return _core.f_upper(1.0 - below, top, bottom)


def f_upper(top: float, bottom: float, above: float) -> float:
    """Value that an F variate exceeds with probability ``above``, however small."""
    return _core.f_upper(above, top, bottom)


def betaincinv(a: float, b: float, below: float) -> float:
    """Value that a beta variate stays below with probability ``below``: an F variate in other words."""
    ratio = a * fdtri(2.0 * a, 2.0 * b, below)
    return ratio / (b + ratio)


def stdtrit(dof: float, below: float) -> float:
    """Value that a Student variate stays below with probability ``below``."""
    return -_core.student_upper(below, dof)


def ndtr(value: float) -> float:
    """Probability that a standard normal variate stays below ``value``."""
    return _core.normal_above(-value)


def ndtri(below: float) -> float:
    """Value that a standard normal variate stays below with probability ``below``."""
    return -_core.normal_upper(below)


def bdtrc(count: float, trials: float, chance: float) -> float:
    """Probability that of ``trials`` more than ``count`` succeed."""
    return _core.binomial_above(count, trials, chance)
