"""Parts of sentences that stages select by id: least determined parameters, poses to add, reasons of a stop."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from trihedron.report.findings.wording import filled

LINES: Mapping[str, str] = MappingProxyType(
    {
        "towards": "/{v1}{v0:axis}",
        "devices": "{v0} ({v1} rows)",
        "unseen": "the {v0} below {v1:.2g}",
        "words": "{v0} ({v1})",
        "streams": "{v0} ({v1} messages)",
        "turns": "{v0:axes} {v1:?starting with {v3:axis} up|{v2:?twice, each of the other axes up once at the "
        "start|and back}}",
    }
)
"""Sentence parts that are repeated for each of several groups of values."""

PHRASES: Mapping[str, str] = MappingProxyType(
    {
        # parameters of a triad
        "scale-of-axis": "scale of {axis:axis}",
        "angle-between-axes": "angle between {one:axis} and {other:axis}",
        "bias-of-axis": "bias of {axis:axis}",
        # poses
        "face": "{is_up:?+|-}{axis:axis} up",
        "pose": "{is_up:?+|-}{axis:axis}{towards:run} {is_edge:?edge|corner} up",
        "poses-unseen": "{names:together}, not observable ({rank} of 9 parameters are determined)",
        "poses-weakest": "{names:together} ({times:.3g} times the uncertainty of the best determined combination)",
        "faces-all": "all faces present",
        "faces-missing": "scale and bias cannot be separated without {faces:&, }",
        # moves and turns of a gyro
        "gyro-scale": "scale of gyro {axis:axis} (S_{axis:letter}{axis:letter})",
        "gyro-share": "gyro cross-axis {axis:axis} into {rate:axis} (S_{rate:letter}{axis:letter})",
        "turns-about": "lay one body axis level and turn the sensor about it by 90 to 120°, with a pose before and "
        "after: {turns:each; }",
        "moves-about-all": "add moves about all three body axes in level position, each with a pose before and after",
        # known attitudes
        "sensitivity-to": "sensitivity to {axis:axis}",
        "bias": "bias",
        "tilt-towards-vertical": "tilt {axis:axis} towards the vertical",
        "bias-both-ways": "place the axis of this bias up and down",
        # why a fit ended
        "small-step": "converged: the Gauss-Newton step no longer changes the parameters",
        "small-gradient": "converged: the residual is orthogonal to every parameter",
        "zero-residual": "converged: the residual vanishes to rounding",
        "no-descent": "stopped: no change reduces the cost any further",
        "too-many-iterations": "stopped: iteration limit reached before convergence",
        "linear-least-squares": "linear least squares",
        # likely mistakes in a model's parameters
        "biases-never-added": "All simulated {sensor} biases are 0: was the drawn bias never applied?",
        "accelerometer-scales-relative": "Scales of the accelerometer are relative to the mean of its three axes: the "
        "{side} is in counts ({per_g:.5g} per g), whose nominal size is not known.",
        "gyro-scales-relative": "Scales of the gyro are relative to the mean of its three axes: the {side} is in "
        "counts ({per_deg_s:.4g} per °/s), whose nominal size is not known.",
        # residuals of a domain
        "static-length": "gravity error in static poses, |f| − |g|",
        "static-rate": "rate in static poses, minus its mean",
        "gravity-missed": "tilt error after a rotation",
        "velocity-over-move": "velocity error over a rotation",
        # empirical relations of what stays unexplained
        "relation-follows": "The {sensor}'s {is_static:?bias|reading in motion} ({axes:axes}) follows "
        "{depends:variables}: {share:.0f %} of the cross-validated misfit.",
        "relation-follows-world": "The gyro's bias follows a vector fixed in the world frame, {inclination_deg:.0f}° ± "
        "{inclination_sigma_deg:.0f}° from the vertical: {share:.0f %} of the cross-validated misfit.",
        "relation-follows-noise": "Noise of the {sensor} is {ratios:all .2g} times ({axes:axes}) its usual level from "
        "{begins_s:.1f} to {ends_s:.1f} s; rotations meanwhile have it too.",
        "relation-form-noise": "standard deviation over the usual one in that interval",
        "relation-form": "reading of {axes:axes} grows by {terms:& + }",
        "relation-form-world": "bias = K Rᵀ m, m a unit vector fixed in the world frame",
        "angle-to-vertical": "angle to the vertical",
        # places in a file, amounts
        "line": "line {line}",
        "row": "row {row}",
        "sample": "sample {sample}, {row}, {time_s:.3f} s",
        "column": "column {column}",
        "devices": "{devices:each}",
        "turns": "the turn that rows take",
        "names": "the line of names",
        "counted": "{words:each}",
        "both": "{one} and {other}",
        "streams": "{streams:each}{has_more:? and others|}",
        "this-container": "This {kind}",
        "unit-with-rate": "{unit:unit} ({rate_hz:.4g} Hz)",
        "amount-of-scatter": "{value:.3g} {unit:unit} in {name:axis}",
        "amount-of-change": "{change:quantity} in {name:axis}",
        # the text of an exception, a finding or an effect as a clause of another sentence
        "because": "{sentence:clause}",
        "quoted": "{sentence}",
        # why a candidate was not accepted
        "held-out-worse": "lowers no cross-validated error",
        "relation-instead": "the relation found explains more",
        "within-flicker": "no larger than 1/f noise that poses do not show",
        # why an effect was not compensated
        "effect-unknown": "this version does not know it",
        "effect-of-session": "it belongs to that session, not to the sensor",
        # why a recording cannot be combined with the others
        "another-correction": "its readings were corrected on board by other parameters than those of the first",
        "not-trusted": "its own calibration is not to be trusted: {seen:opening}",
        "sensor-not-calibrated": "its {sensor} was not calibrated",
        "first-lacks-sensor": "the first recording has no {sensor}",
        "another-unit": "its {sensor} is in {unit:unit}, that of the first recording in {first_unit}",
        "another-gravity": "it was calibrated with another gravity",
        # A simulation's figures beside a recording's: what differs, and which mistake of a simulator it is like.
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


def phrase(name: str, values: Mapping[str, Any]) -> str:
    """The words of a phrase.

    Raises
    ------
    KeyError
        When there is no such phrase, or a placeholder of it has no value.
    """
    return filled(PHRASES[name], values, LINES)
