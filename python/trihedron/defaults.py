"""Defaults that commands and functions share; only light modules are imported, because every ``--help`` needs them."""

from trihedron.errors import InputError

ACCURACY = "accel 0.1 %, gyro 0.2 %"
"""Standard uncertainties of the worst scale at which the guide asks for no more poses."""
FALSE_ALARM = 0.01
"""Probability that a healthy recording, unit or fleet is called anything but consistent."""


def check_alpha(alpha: float) -> None:
    """Reject a false-alarm rate of one half or more, with which a test carries no information."""
    if not 0.0 < alpha < 0.5:
        raise InputError(f"--alpha is a small probability such as {FALSE_ALARM:g}, not {alpha:g}.")
