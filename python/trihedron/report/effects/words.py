"""Words of effects, by id: of the accelerometers, of the gyros, of both sensors, the log and the session."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class EffectWords:
    """Words of one effect.

    ``mechanism`` completes "the model lacks this: ..."; ``experiment`` is the recording that separates it from other
    effects. ``said`` are sentences about the accepted effect by case, with placeholders for values
    (``report/findings/wording.py``); without one the sentence is the mechanism with its strongest term. ``lines`` are
    the parts of placeholders ``{name:each}`` and ``{name:first 4}``.
    """

    mechanism: str
    experiment: str = ""
    said: Mapping[str, str] = field(default_factory=dict)
    lines: Mapping[str, str] = field(default_factory=dict)


LOG_TEMPERATURE = (
    "log the temperature, or let the sensor warm up before the log; poses repeated at its end show the drift"
)
UP_AND_DOWN = "repeat one pose while the temperature both rises and falls: drift in time does not reverse"
TWO_TEMPERATURES = "repeat the same faces and turns at two temperatures"
COME_BACK = (
    "turn away from one pose and back to it ten times: what differs is repeatability, what returns depends on the pose"
)
BOTH_SIDES_OF_LEVEL = (
    "add tilts of 30°, 45° and 60° on both sides of level: a square and a modulus differ between the faces"
)
SHAKE = "shake the sensor about one axis at several frequencies: a delay grows with frequency, a low-pass saturates"


JUMPS = "changes at once at {step_time:.0f} s"


def drifts(sensor: str, unit: str, walk: str, beside: str = "") -> Mapping[str, str]:
    """Bias drift by its kind, ``beside`` what else a slow one may be. Readings of unknown scale in a log of one
    orientation stay counts."""
    whole = f"The {sensor} bias {{how}} by {{sizes}} (X, Y, Z); no logged channel explains it."
    sizes = f"{{is_counts:?{{range:all .3g}} counts|{{range:all .2g {unit}}}}}"
    ways = ("walk", walk, beside), ("static", "drifts smoothly", beside), ("step", JUMPS, "")
    return {way: whole.format(how=how, sizes=sizes) + also for way, how, also in ways}


def saturates(sensor: str) -> EffectWords:
    """Words of the effect of a range limit."""
    end = f"the {sensor} reaches its range limit"
    return EffectWords(
        end,
        "repeat the moves more slowly, or choose a wider range",
        {
            "plateaus": f"T{end[1:]}: {{plateaus}} plateaus, {{samples}} samples, in {{touched}} of {{moves}} moves; "
            "clipped readings are excluded from the fit."
        },
    )


ACCELEROMETER = {
    "accel-cubic": EffectWords(
        "the accelerometers have a cubic nonlinearity, as a differential capacitive bridge does",
        "add tilts between the faces (every 20°): an odd curve bends between level and 1 g",
    ),
    "accel-quadratic": EffectWords("the accelerometers have a quadratic nonlinearity", BOTH_SIDES_OF_LEVEL),
    "accel-scale-asymmetry": EffectWords(
        "the accelerometer scale differs between positive and negative force", BOTH_SIDES_OF_LEVEL
    ),
    "accel-hysteresis": EffectWords(
        "the accelerometer bias depends on the previous orientation",
        "reach the same pose from opposite directions, twice each",
    ),
    "accel-size-effect": EffectWords(
        "the three accelerometers do not sit at one point", "spin and shake the sensor about each axis in turn"
    ),
    "accel-thermal-bias": EffectWords(
        "the accelerometer bias depends on temperature",
        "repeat the temperature cycle, up and down, with the sensor upside down: a bias keeps its sign, a scale error "
        "does not, and a drift in time does not reverse",
    ),
    "accel-thermal-scale": EffectWords("the accelerometer scale depends on temperature", TWO_TEMPERATURES),
    "accel-bias-drift": EffectWords(
        "the accelerometer bias drifts smoothly in time; no logged channel explains it",
        LOG_TEMPERATURE,
        drifts(
            "accelerometer",
            "mm/s²",
            "drifts as a random walk",
            " A settling support has the same effect across gravity.",
        ),
    ),
    "accel-bias-repeatability": EffectWords(
        "the accelerometer bias changes from pose to pose",
        COME_BACK,
        {
            "scatter": "The accelerometer bias repeats only to {sigma:.2g mm/s²} per axis (1 σ) from pose to pose, "
            "beyond noise and drift; neither orientation nor temperature explains it."
        },
    ),
    "accel-saturation": saturates("accelerometer"),
    "lever-arm": EffectWords(
        "the accelerometers sit away from the centre of rotation",
        "turn about another point: a lever arm changes with the centre of rotation, a displacement does not",
        {
            "arm": "The accelerometers sit {arm_m:.1f cm} from the centre of rotation: one arm predicts "
            "{share:.0f %} of the acceleration in cross-validated moves."
        },
    ),
}

GYROSCOPE = {
    "gyro-g-sensitivity": EffectWords(
        "the gyro bias depends on specific force: the static rate changes with the pose",
        "keep each of the six faces up for a minute; turn the table by 180° to rule out Earth rate",
    ),
    "gyro-scale-nonlinearity": EffectWords(
        "the gyro scale depends on rate", "turn by the same angle slowly and fast, both ways, about each axis"
    ),
    "gyro-thermal-bias": EffectWords("the gyro bias depends on temperature", UP_AND_DOWN),
    "gyro-thermal-scale": EffectWords("the gyro scale depends on temperature", TWO_TEMPERATURES),
    "gyro-bias-drift": EffectWords(
        "the gyro bias drifts smoothly in time; no logged channel explains it",
        LOG_TEMPERATURE,
        drifts("gyro", "°/s", "drifts as a random walk beyond its noise"),
    ),
    "gyro-bias-repeatability": EffectWords(
        "the gyro bias changes from pose to pose",
        COME_BACK,
        {
            "scatter": "The gyro bias repeats only to {sigma:all .2g °/s} (X, Y, Z; 1 σ) from pose to pose, beyond "
            "noise and drift; it follows neither gravity nor a logged temperature."
        },
    ),
    "gyro-saturation": saturates("gyro"),
    "earth-rate": EffectWords(
        "the gyros measure the rotation of the Earth",
        "turn the level sensor by 180° on the table: Earth rate changes its horizontal part, g-sensitivity does not",
        {
            "latitude": "the gyros measure the rotation of the Earth (at its rate that is a latitude of "
            "{latitude_deg:abs .0f}° ± {latitude_std_deg:.1g}°; north lies {azimuth_deg:.0f}° ± "
            "{azimuth_std_deg:.1g}° from X of the first pose).",
            "absent": "the gyros do not read the rotation of the Earth: at this latitude {stated:.2g °/s} about the "
            "vertical, and {vertical:.2g °/s} is missing. Simulate it, or leave the latitude out and give gravity.",
        },
    ),
}

SESSION = {
    "accel-gyro-time-offset": EffectWords(
        "accelerometer and gyro samples with the same timestamp were taken at different times", SHAKE
    ),
    "sensor-lag": EffectWords("one sensor follows the motion through a low-pass filter", SHAKE),
    "axis-handedness": EffectWords(
        "the documented axes do not form one right-handed triad",
        "tilt each axis up in turn and turn about it by hand: the signs show which axis is documented wrongly",
        {
            "exchanged": "{is_pair:?{is_gyro:?gyro {moved:axes and} are exchanged against the accelerometer's axes|"
            "accelerometer {moved:axes and} are exchanged against the gyro's axes}|"
            "gyro X, Y and Z turn about accelerometer {directions:each}}.",
            "reversed": "{is_one:?gyro {reversed:axes} turns against accelerometer {reversed:axes}|{is_two:?"
            "accelerometer {kept:axes} points against gyro {kept:axes}, or gyro {reversed:axes and} are both reversed|"
            "every gyro axis turns against the accelerometer's axis of the same name}}: as documented, the axes form "
            "no right-handed triad.",
            "mirrored": "the gyro's axes are of the other handedness than the accelerometer's, and along none of them.",
        },
        lines={"directions": "{v0:?−|}{v1:axis}"},
    ),
    "supply-sensitivity": EffectWords(
        "the readings depend on the supply voltage", "repeat one pose at two supply voltages"
    ),
    "vibration-rectification": EffectWords(
        "the bias depends on the power of vibration", "record one pose with the vibration on and off"
    ),
    "quantisation": EffectWords(
        "the resolution (LSB) is too coarse for the noise: means of poses are quantised",
        "choose a finer range, or add a little motion or noise (dither) while averaging",
        {
            "steps": "Readings of {channels:&, } {is_dead:?do not change within {dead:.4g} raw units of 0|change "
            "in steps of {step:.4g} in raw units (LSB), {times:.2g} times their noise}: averaging does not "
            "resolve less.",
            "missing": "{share:.0f %} of the codes of {channels:&, } never occur between codes that do ({codes:&, } "
            "are missing): readings there come out one LSB higher or lower.",
        },
    ),
    "periodic-interference": EffectWords(
        "a spectral line in the static readings",
        "record a static log at another sampling rate: an aliased line moves, a true one stays",
        {
            "line": "A spectral line at {frequency_hz:.3f} Hz is in {channels:&, } of static poses"
            "{has_more:?; others at {others:each; }|}.",
        },
        lines={"others": "{v0:.3f} Hz in {v1}"},
    ),
    "dropped-samples": EffectWords(
        "samples are missing while the timestamps are even",
        "lower the rate or the load of the link; the sensor's own sample counter shows every loss",
        {
            "losses": "Samples are missing while the timestamps are even: {losses:first 4} "
            "(a loss inside a static pose does not show).",
        },
        lines={"losses": "{v0} at {v1:.2f} s"},
    ),
    "timing-jitter": EffectWords(
        "samples were not taken at their timestamps",
        "let the sensor's own clock trigger the sampling, or log its data-ready times",
        {
            "samples": "Samples are off their timestamps by {jitter_s:.2g ms} rms: both sensors scatter together, "
            "in proportion to the slope of the signal.",
        },
    ),
    "disturbed-pose": EffectWords(
        "a disturbed pose: it was not static",
        "repeat that pose",
        {
            "moved": "Pose {pose:.0f} was disturbed: its mean is off by {off:.2g} m/s²; repeat it, or cut its rows out "
            "of the log.",
            "not-still": "Disturbed poses ({is_timed:?at {disturbed_s:first 4}|}{are_both:?; |}"
            "{is_restless:?not still: {restless:first 4}|}).",
        },
        lines={"disturbed_s": "{v0:.2f} s"},
    ),
    "turn-angle-error": EffectWords(
        "a turn meant to be a multiple of 90° was not",
        "repeat the turns against a stop; turn back by the same angle",
        {
            "turns": "{wrong} of {turns} table turns are not a multiple of 90° (off by up to {most_rad:.1f "
            "!deg}°, others within {near_deg:.0f}°)."
        },
    ),
    "table-tilt": EffectWords(
        "the table is not level",
        "level the table, or record every face in two headings 180° apart and average",
        {"tilt": "The table is tilted by {tilt_deg:.2f}°: turning the sensor on it moves the vertical in the body."},
    ),
}
