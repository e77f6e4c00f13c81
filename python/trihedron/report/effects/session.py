"""Words of the effects of both sensors, of the log, and of the session."""

from __future__ import annotations

from types import MappingProxyType

from trihedron.report.effects.entry import EffectWords
from trihedron.report.effects.shared import SHAKE

ENTRIES = (
    EffectWords(
        "accel-gyro-time-offset",
        "accelerometer and gyro samples with the same timestamp were taken at different times",
        SHAKE,
    ),
    EffectWords("sensor-lag", "one sensor follows the motion through a low-pass filter", SHAKE),
    EffectWords(
        "axis-handedness",
        "the documented axes do not form one right-handed triad",
        "tilt each axis up in turn and turn about it by hand: the signs show which axis is documented wrongly",
        MappingProxyType(
            {
                "reversed": "The documented axes of accelerometer and gyro do not fit one right-handed triad: reversed "
                "is {is_one:?gyro {reversed:axes}, or both other gyro axes and that accelerometer axis|"
                "{is_two:?accelerometer {kept:axes}, or gyro {reversed:axes and}|"
                "{is_three:?all accelerometer axes (the log holds gravity instead of specific force), or all gyro axes|"
                "the order of the axes}}}."
            }
        ),
    ),
    EffectWords(
        "supply-sensitivity", "the readings depend on the supply voltage", "repeat one pose at two supply voltages"
    ),
    EffectWords(
        "vibration-rectification",
        "the bias depends on the power of vibration",
        "record one pose with the vibration on and off",
    ),
    EffectWords(
        "quantisation",
        "the resolution (LSB) is too coarse for the noise: means of poses are quantised",
        "choose a finer range, or add a little motion or noise (dither) while averaging",
        MappingProxyType(
            {
                "steps": "Readings of {channels:&, } {is_dead:?do not change within {dead:.4g} raw units of zero|have "
                "a resolution of {step:.4g} raw units (LSB), {times:.2g} times their noise}: averaging does not "
                "resolve less."
            }
        ),
    ),
    EffectWords(
        "periodic-interference",
        "a spectral line in the static readings",
        "record a static log at another sampling rate: an aliased line moves, a true one stays",
        MappingProxyType({"line": "A spectral line at {frequency_hz:.3f} Hz is in {channels:&, } of static poses."}),
    ),
    EffectWords(
        "dropped-samples",
        "samples are missing while the timestamps are even",
        "log the sensor's own sample counter",
        MappingProxyType(
            {"losses": "Samples are missing while the timestamps are even: {losses:each}{has_more:? and {more} more|}."}
        ),
        lines=MappingProxyType({"losses": "{v0} at {v1:.2f} s"}),
    ),
    EffectWords(
        "timing-jitter",
        "samples were not taken at their timestamps",
        "let the sensor's own clock trigger the sampling, or log its data-ready times",
        MappingProxyType(
            {
                "timestamps": "The timestamps scatter by {rms_s:.2g ms} about an even clock, the readings do not "
                "(share that follows {followed:.2f} ± {sigma:.1g}): the samples were taken evenly.",
                "samples": "Samples are off their timestamps by {jitter_s:.2g ms} rms: both sensors scatter together, "
                "in proportion to the slope of the signal.",
            }
        ),
    ),
    EffectWords(
        "disturbed-pose",
        "a disturbed pose: it was not still, or was pushed",
        "repeat that pose",
        MappingProxyType(
            {
                "pushed": "Pose {pose:.0f} was disturbed: its mean is off by {off:.2g} m/s²; repeat it or exclude it.",
                "not-still": "Disturbed poses ({is_bumped:?at {disturbed_s:each}|}{are_both:?; |}"
                "{is_restless:?not still: {restless:&, }|}).",
            }
        ),
        lines=MappingProxyType({"disturbed_s": "{v0:.2f} s"}),
    ),
    EffectWords(
        "turn-angle-error",
        "a turn meant to be a multiple of 90° was not",
        "repeat the turns against a stop; turn back by the same angle",
        MappingProxyType(
            {
                "turns": "{wrong} of {turns} table turns are not a multiple of 90° (off by up to {most_rad:.1f "
                "!deg}°, others within {near_deg:.0f}°)."
            }
        ),
    ),
    EffectWords(
        "table-tilt",
        "the table is not level",
        "level the table, or record every face in two headings 180° apart and average",
        MappingProxyType(
            {"tilt": "The table is tilted by {tilt_deg:.2f}°: turning the sensor on it moves the vertical in the body."}
        ),
    ),
)
