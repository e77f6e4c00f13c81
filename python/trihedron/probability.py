"""Tail probabilities and quantiles of test distributions; names and arguments as in ``scipy.special``.

They are computed by the core: importing SciPy takes longer than a calibration.
"""

import math

from trihedron import _core

LEAST_P = 1e-300
"""Smallest p-value stated: a double holds it with full precision, and its logarithm exists."""
NORMAL_95 = 1.96
"""Half-width of a 95 % interval of a normal variate, in standard deviations."""

FALSE_ALARM = 1e-3
"""Probability that any one test of a fit, or of what is held against it, rejects what is sound."""
RARE_ALARM = 1e-4
"""The same of a test that is asked at very many places: events and lines of a log, still windows, of which one that
counts as moving leaves a short gap once in minutes."""


def chdtrc(dof: float, value: float) -> float:
    """Probability that a chi-square variate exceeds ``value``."""
    return _core.chi_square_above(value, dof)


def chdtri(dof: float, above: float) -> float:
    """Value that a chi-square variate exceeds with probability ``above``."""
    return _core.chi_square_upper(above, dof)


LN_FAULT = math.log(1e4)
"""Logarithm of the prior odds against a fault of one kind (a reset, a copied buffer, bus errors) in a log."""
MEDIAN_CHI2 = {dof: chdtri(dof, 0.5) for dof in (1, 2)}
"""Median of a chi-square variate with 1 and 2 degrees of freedom, for robust scale estimates."""


def fdtrc(top: float, bottom: float, value: float) -> float:
    """Probability that an F variate exceeds ``value``."""
    return _core.f_above(value, top, bottom)


def f_upper(top: float, bottom: float, above: float) -> float:
    """Value that an F variate exceeds with probability ``above``, which may be very small."""
    return _core.f_upper(above, top, bottom)


def betaincinv(a: float, b: float, below: float) -> float:
    """Value that a beta variate stays below with probability ``below``, from the F distribution."""
    ratio = a * f_upper(2.0 * a, 2.0 * b, 1.0 - below)
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


STRONG = 20.0
"""Odds that are strong evidence (Kass, Raftery 1995), asked after everything that could be chosen was chosen."""
STRONG_SCORE = 2.0 * math.log(STRONG)
"""The same as a score, twice a log-likelihood."""
CLEAR = 3.0
"""Standard errors from which a figure clearly differs: by chance once in 370."""
SURE = ndtri(1.0 - 0.5 * RARE_ALARM)
"""The same (3.9) of a figure that is asked at many places."""


def bdtrc(count: float, trials: float, chance: float) -> float:
    """Probability of more than ``count`` successes in ``trials`` with success probability ``chance``."""
    return _core.binomial_above(count, trials, chance)
