"""Words of the effects of both sensors, of the log, and of how the session was done."""

from __future__ import annotations

from types import MappingProxyType

from trihedron.report.effects.entry import EffectWords
from trihedron.report.effects.shared import SHAKE

ENTRIES = (
    EffectWords(
        "accel-gyro-time-offset",
        "accelerometer and gyro samples with the same timestamp belong to different instants",
        SHAKE,
    ),
    EffectWords(
        "sensor-lag",
        "one sensor follows the motion through a low-pass filter",
        SHAKE,
    ),
    EffectWords(
        "axis-handedness",
        "the documented axes do not form one right-handed triad",
        "tilt each axis up in turn and turn about it by hand: the signs show which axis is documented wrongly",
        MappingProxyType(
            {
                "reversed": "The documented axes of accelerometer and gyro do not fit one right-handed triad: reversed "
                "is {is_one:?gyro axis {reversed:&, }, or both other gyro axes and that accelerometer axis|"
                "{is_two:?accelerometer axis {kept:&, }, or gyro axes {reversed:and}|"
                "{is_three:?all accelerometer axes (the log holds gravity instead of specific force), or all gyro axes|"
                "the order of the axes}}}."
            }
        ),
    ),
    EffectWords(
        "supply-sensitivity",
        "readings follow the supply voltage",
        "repeat one pose at two supply voltages",
    ),
    EffectWords(
        "vibration-rectification",
        "bias follows the power of vibration",
        "hold one pose with the vibration on and off",
    ),
    EffectWords(
        "quantisation",
        "the resolution is too coarse for the noise: means of poses sit on steps",
        "choose a finer range, or add a little motion or noise (dither) while averaging",
        MappingProxyType(
            {
                "steps": "Readings of {channels:&, } {is_dead:?do not move within {dead:.4g} raw units of zero|move in "
                "steps of {step:.4g} raw units, {times:.2g} times their noise}: averaging does not resolve between "
                "steps."
            }
        ),
    ),
    EffectWords(
        "periodic-interference",
        "a sinusoid stands in the readings while the sensor is still",
        "record at rest at another sampling rate: an aliased line moves, a true one stays",
        MappingProxyType(
            {"line": "A line at {frequency_hz:.3f} Hz stands in {channels:&, } while the sensor is still."}
        ),
    ),
    EffectWords(
        "dropped-samples",
        "samples are missing though the timestamps run on evenly",
        "log the sensor's own sample counter",
        MappingProxyType(
            {"losses": "Samples are missing though the timestamps run on: {losses:each}{has_more:? and {more} more|}."}
        ),
        lines=MappingProxyType({"losses": "{v0} at {v1:.2f} s"}),
    ),
    EffectWords(
        "timing-jitter",
        "samples are taken at other instants than their timestamps say",
        "let the sensor's own clock trigger the sampling, or log its data-ready times",
        MappingProxyType(
            {
                "stamps": "The timestamps scatter by {rms_s:.2g ms} about an even clock, but the readings do not "
                "follow them (share {followed:.2f} ± {sigma:.1g}): the samples were taken evenly.",
                "samples": "Every sample is off its timestamp by about {jitter_s:.2g ms}: both sensors' steps scatter "
                "together, with the slope of the signal.",
            }
        ),
    ),
    EffectWords(
        "disturbed-pose",
        "one pose was not still or was pushed",
        "repeat that pose",
        MappingProxyType(
            {
                "pushed": "Pose {pose:.0f} was not still or was pushed: its mean is off by {off:.2g} m/s²; repeat or "
                "leave it out.",
                "not-still": "Not every pose was still ({is_bumped:?bumped at {bumped_s:each}|}{are_both:?; |}"
                "{is_restless:?restless: pose {restless:&, }|}).",
            }
        ),
        lines=MappingProxyType({"bumped_s": "{v0:.2f} s"}),
    ),
    EffectWords(
        "turn-angle-error",
        "a turn meant to be a multiple of 90° was not",
        "repeat the turns against a stop; turn back by the same angle",
        MappingProxyType(
            {
                "turns": "{wrong} of {turns} table turns miss their multiple of 90° (up to {most_rad:.1f !deg}°, "
                "others within {near_deg:.0f}°)."
            }
        ),
    ),
    EffectWords(
        "table-tilt",
        "the table is not level",
        "level the table, or hold every face in two headings 180° apart and average",
        MappingProxyType(
            {"tilt": "The table is tilted by {tilt_deg:.2f}°: turning the sensor on it moves the vertical in the body."}
        ),
    ),
)
