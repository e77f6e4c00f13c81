"""Remarks on a simulation's figures beside a recording's: what differs, and which mistake of a simulator it is like."""

from collections.abc import Mapping
from types import MappingProxyType

COMPARED: Mapping[str, str] = MappingProxyType(
    {
        # white noise and its distribution
        "model-uniform": "The noise of the model's {sensor} is uniformly distributed; the recording's is normal.",
        "model-one-draw": "The noise of the model's {sensor} is one and the same on all three axes (they correlate by "
        "{model:.2f}, the recording's by {recording:.2f}): it was drawn once instead of three times.",
        "noise-missing": "The {side} has no noise on the {sensor}; the {other} has.",
        "noise-hidden": "The resolution (LSB) of the {side} hides the noise of its {sensor}.",
        "white-by-rate": "White noise of the {sensor} is {ratio:.3g} = {is_above:?|1/}√{rate_hz:.4g} times the "
        "recording's: the density was {is_above:?multiplied by the root of the rate once too often|not multiplied by "
        "the root of the rate when it was sampled}.",
        "white-same-on-axes": "White noise of the {sensor} is the same on all axes of the model; the recording's axes "
        "differ {times:.2g} times.",
        "white-ratio": "White noise of the {sensor} is {ratio:.3g} ({low:.3g} to {high:.3g}) times the recording's.",
        "octave-ratio": "Noise of the {sensor} {axis:axis} at {low_hz:g} to {high_hz:g} Hz is {ratio:.3g} times the "
        "recording's.",
        "filtered-once": "The noise of the {sensor} {axis:axis} is filtered in the {side} only (corner "
        "{corner_hz:.3g} Hz).",
        # the ADC
        "resolution-missing": "The {side} has no resolution (LSB) on the {sensor}.",
        "resolution-ratio": "The resolution (LSB) of the {sensor} is {ratio:.3g} times the recording's.",
        "quantisation-ratio": "Quantisation noise of the {sensor} {axis} is {ratio:.2g} times the recording's.",
        "quantisation-once": "Only the {side} has quantisation noise on the {sensor} {axis}: noise that rises with "
        "frequency.",
        "range-ratio": "The {sensor} of the model counts {ratio:g} times as many per unit: another range of the part.",
        "unit-of-side": "The {sensor} of the model reads {ratio:.4g} times the recording's: the {side} writes "
        "{written} where it says {taken}.",
        "unit-ratio": "The {sensor} of the model reads {ratio:.4g} times the recording's, the ratio of {taken} to "
        "{written}: one of the two is in the wrong unit.",
        # sampling
        "rate-ratio": "The model samples at {model_hz:.5g} Hz, the recording at {recording_hz:.5g} Hz.",
        "timestamps-scatter": "The timestamps of the {side} scatter by {larger_s:.2g ms}, the other's by "
        "{smaller_s:.2g ms}.",
        "clock-perfect": "The clock of the model is perfect; the timestamps of the recording scatter by "
        "{jitter_s:.2g ms}.",
        # slow noise
        "one-time-for-both": "The noise of both sensors of the model forgets in the same time, {model_s:.2g} s; the "
        "recording's accelerometer in {accelerometer_s:.2g} s, its gyro in {gyroscope_s:.2g} s: one time constant was "
        "used for both.",
        "time-ratio": "The noise of the {sensor} forgets in {model_s:.2g} s, the recording's in {recording_s:.2g} s.",
        "slow-ratio": "{is_flicker:?Bias instability|The walk} of the {sensor} is {ratio:.2g} times the recording's.",
        "walk-by-rate": "The walk of the {sensor} is {ratio:.2g} times the recording's, about {is_above:?√{rate_hz:.4g}"
        ": its steps were not scaled by the root of the time step|1/√{rate_hz:.4g}: its steps were scaled by the time "
        "step instead of its root}.",
        "slow-unseen": "Not long enough to show {term}: 0 is not excluded, 97.5 % of {unseen:each and }; the figure is "
        "a median.",
        # motion and frame
        "poses-miss": "The gravity errors in poses of the model, moved as the log was, are {ratio:.2f} times as large "
        "as the log's ({level:g} % {low:.2f} to {high:.2f}, {simulations} simulations); {is_above:?noise inside the "
        "poses (a tremor, a line) does not go on between them as the model's does|the bias changes from pose to pose "
        "by more than the model's noise}.",
        "moves-miss": "The tilt errors after rotations of the model, moved as the log was, are {ratio:.2f} times as "
        "large as the log's ({level:g} % {low:.2f} to {high:.2f}, {simulations} simulations); {is_above:?the gyro of "
        "the model strays more in moves than this one|the gyro's bias changes during moves, or motion is faster than "
        "the samples}.",
        "rates-of-world": "The gyro of the model reads rates along the axes of the world, not of the body: the tilt "
        "error after rotations is {body_rad:.0f deg} if they are the body's and {world_rad:.1f deg} if they are the "
        "world's. Turn them by the transpose of the attitude; until then only its accelerometer is compared.",
        "gravity-upside-down": "Gravity has the opposite sign in the model, pose by pose: a static accelerometer reads "
        "+g along the axis that points up (specific force), not −g.",
    }
)
