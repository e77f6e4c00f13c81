"""Signatures of the compiled core. A test compares this stub with the runtime."""

from collections.abc import Sequence
from typing import ClassVar, final

import numpy as np
import numpy.typing as npt

from trihedron.arrays import BoolArray, FloatArray

class InputError(ValueError): ...

# accelerometer
ANCHOR: float

@final
class NormFit:
    S: FloatArray
    b: FloatArray
    residuals: FloatArray
    sigmas: FloatArray
    chi2: float
    rank: int
    is_anchored: bool
    is_converged: bool
    stopped_because: str
    n_iterations: int

def fit_norm(readings: FloatArray, noise: FloatArray, gravity_m_s2: float) -> NormFit: ...
def fit_norm_held_out(
    readings: FloatArray, noise: FloatArray, gravity_m_s2: float, fit: NormFit, folds: Sequence[int]
) -> FloatArray: ...
def errors_of_lengths(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, prior: float | None = None
) -> tuple[FloatArray, list[float], list[float]]: ...

# allan
@final
class AllanKind:
    Overlapping: ClassVar[AllanKind]
    NonOverlapping: ClassVar[AllanKind]
    Modified: ClassVar[AllanKind]
    Hadamard: ClassVar[AllanKind]
    Total: ClassVar[AllanKind]
    def __int__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class AllanNoise:
    Quantisation: ClassVar[AllanNoise]
    White: ClassVar[AllanNoise]
    Flicker: ClassVar[AllanNoise]
    Walk: ClassVar[AllanNoise]
    def __int__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...

def allan_degrees(n: int, m: int, noise: AllanNoise, kind: AllanKind) -> float: ...
def allan_degrees_along(
    n: int, clusters: Sequence[int], variance: Sequence[float], weight: Sequence[float], kind: AllanKind
) -> tuple[list[float], list[float]]: ...
def allan_variance(
    x: FloatArray, clusters: Sequence[int], kind: AllanKind
) -> tuple[FloatArray, npt.NDArray[np.int64], FloatArray]: ...

@final
class AllanStream:
    LEAST_BUDGET: ClassVar[int]
    def __new__(cls, channels: int, clusters: Sequence[int], budget: int) -> AllanStream: ...
    def extend(self, x: FloatArray) -> None: ...
    def finish(self) -> tuple[list[int], FloatArray, npt.NDArray[np.int64], int, int, list[float]]: ...
    def means(self, channel: int, readings: int) -> tuple[FloatArray, int]: ...

# chi-square
def chi_square_above(value: float, dof: float) -> float: ...
def chi_square_upper(above: float, dof: float) -> float: ...
def normal_above(value: float) -> float: ...
def normal_upper(above: float) -> float: ...
def f_above(value: float, top: float, bottom: float) -> float: ...
def f_upper(above: float, top: float, bottom: float) -> float: ...
def student_upper(above: float, dof: float) -> float: ...
def binomial_above(count: float, trials: float, chance: float) -> float: ...

# screening
def find_jumps(x: FloatArray, scales: Sequence[tuple[int, int, float]]) -> list[tuple[float, int, int, float]]: ...
def block_scatter(x: FloatArray, size: int) -> FloatArray: ...

# spectral likelihood
@final
class SpectralBins:
    def __new__(
        cls,
        count: FloatArray,
        power: FloatArray,
        cross: FloatArray,
        square: FloatArray,
        basis: FloatArray,
    ) -> SpectralBins: ...
    def fit(self, active: Sequence[int]) -> SpectralFit: ...
    def invert(self, rise: float, pair: tuple[int, int], walk: int, line_outside: float) -> SpectralInversion: ...

@final
class SpectralInversion:
    @property
    def most_likely(self) -> list[float]: ...
    @property
    def median(self) -> list[float]: ...
    @property
    def spread(self) -> list[float]: ...
    @property
    def lower(self) -> list[float]: ...
    @property
    def upper(self) -> list[float]: ...
    @property
    def rise_without(self) -> list[float]: ...
    @property
    def strength_at_ends(self) -> list[list[float]]: ...
    @property
    def strength(self) -> list[float]: ...
    @property
    def strength_without_pair(self) -> list[float]: ...
    @property
    def rise_without_pair(self) -> float: ...
    @property
    def slope(self) -> float: ...
    @property
    def sigma_slope(self) -> float: ...
    @property
    def slope_lower(self) -> float: ...
    @property
    def slope_upper(self) -> float: ...
    @property
    def slope_tail(self) -> float: ...

@final
class SpectralFit:
    @property
    def strength(self) -> list[float]: ...
    @property
    def columns(self) -> list[float]: ...
    @property
    def deviance(self) -> float: ...
    @property
    def log_determinant(self) -> float: ...

# rotation
def rotation_from_vector(vectors: FloatArray) -> FloatArray: ...
def vector_from_rotation(rotations: FloatArray) -> FloatArray: ...

# poisson
@final
class RateNoise:
    def __new__(cls, density: FloatArray, sigma_time_s: float, nominal_step_s: float) -> RateNoise: ...

def integrate_moves(
    time_s: FloatArray,
    gyroscope: FloatArray,
    moves: npt.NDArray[np.int64],
    anchors_s: FloatArray,
    scale: FloatArray,
    bias_before: FloatArray,
    bias_after: FloatArray,
    rate_degree: int,
    noise: RateNoise,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
def integrate_raw_rate(
    time_s: FloatArray,
    gyroscope: FloatArray,
    moves: npt.NDArray[np.int64],
    rate_degree: int,
) -> tuple[FloatArray, list[float]]: ...

# text
def new_array(rows: int, width: int) -> FloatArray: ...
def plain_table_into(
    text: npt.NDArray[np.uint8], separator: int, places: list[tuple[int, int]], blocks: list[FloatArray]
) -> tuple[int, bool]: ...

# audit
def triad_extremes(readings: FloatArray) -> list[tuple[float, int, float, int]]: ...
def triad_largest_steps(readings: FloatArray) -> list[float]: ...
def triad_repeats(
    readings: FloatArray,
) -> tuple[list[int], list[int], list[int], npt.NDArray[np.uint8], int, int | None]: ...
def triad_leaps(
    readings: FloatArray, noise: Sequence[float] | FloatArray, least: float
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]: ...
def triad_copies(readings: FloatArray, farthest: int, least: int) -> list[tuple[int, int]]: ...
def readings_near(
    readings: FloatArray, axis: int, value: float, depth: float
) -> tuple[int, float, npt.NDArray[np.int64]]: ...

# first look
def levels_of(readings: FloatArray) -> tuple[FloatArray, int]: ...
def adc_grid(levels: FloatArray, n: int) -> float | None: ...
def before_adc(
    values: FloatArray, counts: Sequence[int], step: float
) -> tuple[float, FloatArray, FloatArray, float]: ...
def window_statistics(
    readings: FloatArray, starts: npt.NDArray[np.int64], length: int
) -> tuple[FloatArray, FloatArray, FloatArray] | None: ...
def median_length(readings: FloatArray, starts: npt.NDArray[np.int64], length: int) -> float: ...
def block_mean_readings(readings: FloatArray, length: int, count: int) -> FloatArray: ...
def quickest_turns(readings: FloatArray, side: int, turn: float) -> tuple[int | None, int | None]: ...
def running_median(values: FloatArray, size: int) -> FloatArray: ...
def roughness(values: FloatArray, width: int) -> FloatArray: ...

# motion in the means of blocks
def ends_to_trim(
    rows: FloatArray,
    bumps: list[tuple[int, int]],
    noise: FloatArray,
    rounding: FloatArray,
    step_s: float,
    variances: FloatArray,
    is_live: BoolArray,
    limit: float,
) -> tuple[int, int, bool]: ...
def sharpened(readings: FloatArray, time_s: FloatArray, share: float) -> FloatArray: ...
def unresolved_variance(
    readings: FloatArray,
    ranges: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]],
    time_s: FloatArray,
    step_s: float,
    quantum: FloatArray,
) -> FloatArray: ...
def share_of_gyroscope(change: FloatArray, mean: FloatArray, rate: FloatArray, scale: list[float]) -> list[float]: ...

# the noise floor of a log
def noise_floor(
    mean: FloatArray,
    variance: FloatArray,
    is_valid: BoolArray,
    tells: BoolArray,
    rounding: FloatArray,
    length: int,
    search: tuple[int, int, float],
    tails: tuple[float, float],
) -> tuple[FloatArray, FloatArray, list[float], BoolArray, FloatArray, FloatArray]: ...
def still_limit(activity: FloatArray, freedom: int, tails: tuple[float, float]) -> float: ...
def rolling_mean(values: FloatArray, width: int) -> FloatArray: ...

# order statistics
def column_medians(values: FloatArray) -> FloatArray: ...
def column_quantiles(values: FloatArray, at: list[float]) -> FloatArray: ...

# means over ranges of rows
def means_by_owner(
    readings: FloatArray, ranges: npt.NDArray[np.int64], owner: npt.NDArray[np.int64], n: int
) -> tuple[FloatArray, npt.NDArray[np.int64]]: ...
def column_means(
    values: FloatArray, ranges: npt.NDArray[np.int64], owner: npt.NDArray[np.int64], n: int
) -> FloatArray: ...
def block_differences(
    readings: FloatArray, ranges: npt.NDArray[np.int64], owner: npt.NDArray[np.int64], length: int
) -> tuple[list[float], int]: ...
def half_changes(readings: FloatArray, ranges: npt.NDArray[np.int64]) -> FloatArray: ...
def flicker_scatter(
    readings: FloatArray, poses: npt.NDArray[np.int64], up: FloatArray | None, fewest: int
) -> float: ...
def coloured_variance(
    readings: FloatArray,
    poses: tuple[npt.NDArray[np.int64], FloatArray],
    density: FloatArray,
    step_s: float,
    moves_last: Sequence[float],
) -> FloatArray: ...
def noise_change(
    readings: FloatArray,
    least: Sequence[float],
    poses: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int],
    moves: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]],
    fewest: int,
) -> tuple[int, int, list[int], list[float], list[float], float, float] | None: ...

# joints of a motion, and the law of its noise
def motion_joints(
    readings: Sequence[FloatArray],
    moves: npt.NDArray[np.int64],
    time_s: tuple[FloatArray, float],
    is_cut: BoolArray | None,
    most: int,
    least: float,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], FloatArray, FloatArray, int]: ...
def halves_of(
    blocks: FloatArray, stretches: npt.NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64], npt.NDArray[np.int64]]: ...
def mean_noise_terms(
    design: FloatArray, seen: FloatArray, n: FloatArray, chosen: list[int]
) -> tuple[float, list[float]]: ...

# rounding
_Adc = tuple[FloatArray, FloatArray, BoolArray]

def rounding_variance(readings: FloatArray, adc: _Adc, steady: tuple[float, int]) -> FloatArray: ...
def rounding_in_moves(
    readings: FloatArray, adc: _Adc, edges: npt.NDArray[np.int64], steady: tuple[float, int]
) -> tuple[FloatArray, FloatArray, FloatArray]: ...

# the arm from the centre of rotation
def lever_arm_of_moves(
    motion: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    attitude: FloatArray,
    moves: npt.NDArray[np.int64],
    *,
    rate_hz: float,
    fewest: int,
) -> tuple[FloatArray, FloatArray, float, tuple[float, float], int] | None: ...

# supports that settle, sampling instants that scatter
def settling_of_poses(
    readings: tuple[FloatArray, ...],
    scale: tuple[FloatArray, ...],
    noise: tuple[FloatArray, ...],
    up: FloatArray,
    spans: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]],
    *,
    gravity_m_s2: float,
    step_s: float,
    fewest: int,
    certain: float,
) -> tuple[float, float, FloatArray, FloatArray, FloatArray] | None: ...
def common_time_variance(
    time_s: FloatArray,
    step_s: float,
    readings: tuple[FloatArray, ...],
    is_clipped: BoolArray,
    moves: npt.NDArray[np.int64],
) -> tuple[float, float, int]: ...

# spectral lines inside poses
_Three = tuple[float, float, float]

def poses_beside_lines(
    readings: FloatArray, spans: npt.NDArray[np.int64], sigma: FloatArray, fewest: int
) -> tuple[FloatArray, FloatArray, FloatArray]: ...
def session_lines(
    times: Sequence[FloatArray], readings: Sequence[FloatArray], rate_hz: float, p_limit: float
) -> list[tuple[int, _Three, tuple[float, float], float, float, tuple[float, float]]]: ...

# random telegraph signals
def telegraph_inside(readings: FloatArray, counts: Sequence[int]) -> tuple[BoolArray, FloatArray, float]: ...
def telegraph_levels(
    inside: tuple[BoolArray, FloatArray, float],
    known: FloatArray,
    means: tuple[FloatArray, FloatArray, FloatArray, float],
) -> tuple[FloatArray, float] | None: ...
def two_levels(values: FloatArray, guess: tuple[float, float]) -> tuple[float, list[float], BoolArray]: ...

# timestamps
def phase_power(windows: Sequence[FloatArray], cell: float, least: int) -> tuple[FloatArray, int]: ...
def direct_power(timestamps: FloatArray, first: float, step: float, count: int) -> FloatArray: ...
def timestamp_steps(time: FloatArray) -> tuple[int, int, int, int]: ...
def usual_step(time: FloatArray) -> float: ...
def timestamp_errors(time: FloatArray, even: FloatArray) -> None: ...
def errors_deviation(errors: FloatArray) -> float: ...
def errors_falls(errors: FloatArray, fall: float) -> int: ...
def steps_above(time: FloatArray, limit: float) -> npt.NDArray[np.int64]: ...
def inside_steps(time: FloatArray, above: float, limit: float) -> tuple[int, float, float, float, float]: ...
def timestamp_lateness(
    time: FloatArray, ticks: npt.NDArray[np.signedinteger] | None, period: float, late: FloatArray
) -> None: ...
def earliest_timestamps(late: FloatArray, width: int) -> npt.NDArray[np.int64]: ...
def block_medians(late: FloatArray, width: int) -> FloatArray: ...
def block_mean_ticks(ticks: npt.NDArray[np.signedinteger], width: int) -> FloatArray: ...
def robust_line(u: FloatArray, y: FloatArray) -> tuple[float, float]: ...
def lay_even_clock(
    ticks: npt.NDArray[np.signedinteger],
    line: tuple[float, float],
    origin: float,
    scale: float,
    period: float,
    even: FloatArray,
) -> None: ...

# stillness
def block_statistics(readings: FloatArray, length: int) -> tuple[FloatArray, FloatArray, npt.NDArray[np.uint32]]: ...

# simulate
def simulate_motion(
    segments: FloatArray,
    wobble: FloatArray,
    shake: FloatArray,
    replay: FloatArray,
    time_s: FloatArray,
    gravity_m_s2: float,
    earth_rate_rad_s: Sequence[float],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...

# kalman
@final
class AxisKalmanModel:
    def __new__(
        cls,
        *,
        quantisation: float,
        white: float,
        flicker: float,
        walk: float,
        ramp: float,
        gauss_markov: float,
        gauss_markov_rate: float,
        resolution: float,
        dither: float,
        flicker_rates: Sequence[float],
        ramp_frequency: float,
        ramp_damping: float,
        averages: bool,
    ) -> AxisKalmanModel: ...
    def white_variance(self, pose_s: float) -> float: ...
    def fast_variance(self, pose_s: float) -> float: ...

@final
class KalmanStart:
    def __new__(cls, mean: FloatArray, sigma: FloatArray, walk: FloatArray) -> KalmanStart: ...

@final
class KalmanPoses:
    def __new__(
        cls,
        readings: FloatArray,
        references: FloatArray,
        start_s: FloatArray,
        pose_s: FloatArray,
        extra_variance: FloatArray,
    ) -> KalmanPoses: ...

@final
class NormKalman:
    def __new__(
        cls,
        model_x: AxisKalmanModel,
        model_y: AxisKalmanModel,
        model_z: AxisKalmanModel,
        symmetric: bool,
        gravity: float,
        prior_mean: FloatArray,
        prior_sigma: FloatArray,
    ) -> NormKalman: ...
    def add(
        self,
        reading: Sequence[float],
        start_s: float,
        pose_s: float,
        extra_variance: Sequence[float] = ...,
    ) -> tuple[float, float]: ...
    def load(
        self, readings: FloatArray, start_s: FloatArray, pose_s: FloatArray, extra_variance: FloatArray
    ) -> None: ...
    def relinearise(self, most: int) -> int | None: ...
    @property
    def parameters(self) -> FloatArray: ...
    @property
    def covariance(self) -> FloatArray: ...
    @property
    def innovations(self) -> FloatArray: ...

def kalman_track(
    model: AxisKalmanModel, start: KalmanStart, poses: KalmanPoses
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
def kalman_smooth(
    model: AxisKalmanModel, start: KalmanStart, poses: KalmanPoses
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...
def kalman_noise_covariance(
    model: AxisKalmanModel, start_s: FloatArray, pose_s: FloatArray, extra_variance: FloatArray
) -> FloatArray: ...
def kalman_least_squares(
    readings: FloatArray,
    references: FloatArray,
    variance: float,
    prior_mean: FloatArray,
    prior_sigma: FloatArray,
) -> tuple[FloatArray, FloatArray]: ...
def kalman_generalised_least_squares(
    model: AxisKalmanModel, start: KalmanStart, poses: KalmanPoses
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
def simulate_noise(
    n: int, dt_s: float, terms: Sequence[Sequence[float]], keys: Sequence[Sequence[int]]
) -> FloatArray: ...
def simulate_project(signal: FloatArray, directions: Sequence[Sequence[float]]) -> FloatArray: ...
def simulate_force_at_places(
    force: FloatArray,
    rate: FloatArray,
    rate_change: FloatArray,
    places: Sequence[Sequence[float]],
    directions: Sequence[Sequence[float]],
) -> FloatArray: ...
def simulate_second_order(
    signal: FloatArray, dt_s: float, frequency_hz: Sequence[float], quality: Sequence[float]
) -> FloatArray: ...
def simulate_first_order(signal: FloatArray, dt_s: float, tau_s: Sequence[float]) -> FloatArray: ...
def simulate_bridge(
    signal: FloatArray,
    deflection: Sequence[float],
    second: Sequence[float],
    third: Sequence[float],
    mismatch: Sequence[float],
) -> FloatArray: ...
def simulate_play(signal: FloatArray, width: Sequence[float], offset: Sequence[float]) -> FloatArray: ...
def simulate_creep(
    signal: FloatArray, dt_s: float, fraction: Sequence[float], tau_s: Sequence[float]
) -> FloatArray: ...
def simulate_resample(signal: FloatArray, start_s: float, dt_s: float, time_s: FloatArray) -> FloatArray: ...
def simulate_convert(
    signal: FloatArray,
    lsb: float,
    low: float,
    high: float,
    dead_band: float,
    bias: Sequence[float],
    missing_every: int,
) -> FloatArray: ...

# attitude
def integrate_rate(
    time_s: FloatArray,
    rate: FloatArray,
    rate_degree: int,
    form: int,
    is_last_only: bool,
    initial: FloatArray | None,
) -> FloatArray: ...

# the joint model of a session
@final
class SessionPoses:
    def __new__(
        cls,
        *,
        time_s: FloatArray,
        force: FloatArray,
        force_sigma: FloatArray,
        force_density: FloatArray,
        rate: FloatArray | None,
        rate_sigma: FloatArray | None,
        rate_density: FloatArray | None,
        force_along: tuple[FloatArray, FloatArray] | None = None,
    ) -> SessionPoses: ...
    def force_white(self) -> FloatArray: ...

@final
class SessionMoves:
    def __new__(
        cls,
        *,
        pose_time_s: FloatArray,
        time_s: FloatArray,
        force: FloatArray,
        rate: FloatArray | None,
        ranges: npt.NDArray[np.int64],
        before: npt.NDArray[np.int64],
        unresolved: FloatArray,
        leans: FloatArray,
    ) -> SessionMoves: ...

@final
class SessionState:
    def __new__(
        cls,
        *,
        force_scale: FloatArray,
        force_bias: FloatArray,
        rate_scale: FloatArray,
        up: FloatArray,
        pose_rate_bias: FloatArray,
        pose_force_bias: FloatArray,
        effect: FloatArray,
    ) -> SessionState: ...

_Pair = tuple[float, float]
_Strengths = tuple[_Pair, tuple[float, float, float, float], _Pair, _Pair]
_Asked = tuple[FloatArray | None, FloatArray | None, list[float]]

@final
class SessionModel:
    def __new__(
        cls,
        *,
        gravity: _Pair,
        poses: SessionPoses,
        moves: SessionMoves,
        noise: _Pair,
        prior: tuple[FloatArray, FloatArray, bool] | None,
        scatter: tuple[FloatArray, float],
    ) -> SessionModel: ...
    def fit(
        self,
        *,
        state: SessionState,
        strengths: _Strengths,
        force_effect: FloatArray | None,
        rate_effect: FloatArray | None,
        within: tuple[_Pair, _Pair, _Pair] | None = None,
        sizes: Sequence[float] | None = None,
        is_near: bool = False,
        is_rough: bool = False,
    ) -> SessionFit: ...

@final
class SessionFit:
    @property
    def force_scale(self) -> FloatArray: ...
    @property
    def force_bias(self) -> FloatArray: ...
    @property
    def session_force_bias(self) -> FloatArray: ...
    @property
    def rate_scale(self) -> FloatArray: ...
    @property
    def up(self) -> FloatArray: ...
    @property
    def pose_rate_bias(self) -> FloatArray: ...
    @property
    def pose_force_bias(self) -> FloatArray: ...
    @property
    def effect(self) -> FloatArray: ...
    @property
    def strengths(self) -> _Strengths: ...
    @property
    def chi2(self) -> float: ...
    @property
    def log_marginal(self) -> float: ...
    @property
    def is_converged(self) -> bool: ...
    @property
    def stopped_because(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def residual(self) -> FloatArray: ...
    @property
    def labels(self) -> npt.NDArray[np.int64]: ...
    def path(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...
    def attitude(self) -> FloatArray: ...
    def moves(self) -> tuple[FloatArray, FloatArray]: ...
    @property
    def tails(self) -> FloatArray: ...
    def whitening(self) -> FloatArray: ...
    def moves_over_predicted(self) -> FloatArray: ...
    def columns(self, force: FloatArray | None, rate: FloatArray | None) -> FloatArray: ...
    def evidence(
        self, hypotheses: Sequence[_Asked], strengths: Sequence[_Strengths], within: tuple[_Pair, _Pair, _Pair]
    ) -> list[tuple[float, _Strengths, FloatArray, FloatArray]]: ...
    def candidate_gains(
        self,
        candidates: Sequence[_Asked],
        scales: Sequence[float],
        strengths: Sequence[_Strengths],
        parts: Sequence[Sequence[Sequence[int]]] | None = None,
    ) -> list[tuple[FloatArray, FloatArray, FloatArray]]: ...
    def lost_samples(self, shares: Sequence[float]) -> tuple[FloatArray, FloatArray, FloatArray] | None: ...
    def leverage(self) -> FloatArray: ...
    def held_out(
        self, folds: npt.NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...
    def border_covariance(self) -> FloatArray: ...
    def linear_covariance(self, force_origin: FloatArray, rate_origin: FloatArray) -> tuple[FloatArray, FloatArray]: ...
    def without(
        self, folds: npt.NDArray[np.bool_], force_origin: FloatArray
    ) -> list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]: ...
    def jacobian(self) -> FloatArray: ...

# sinusoid
def sinusoid_power(
    time_s: FloatArray, readings: FloatArray, *, start_hz: float, step_hz: float, count: int
) -> FloatArray: ...

# signals of effects
def scale_from_moves(
    time_s: FloatArray,
    sensors: tuple[FloatArray, FloatArray],
    direct: tuple[FloatArray, FloatArray],
    moves: npt.NDArray[np.int64],
    bias: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    given: FloatArray | None,
    nominal: float | None,
) -> FloatArray | None: ...
def play(path: FloatArray, half_width: float) -> FloatArray: ...
def channel_slope(values: FloatArray, time_s: FloatArray, rate_hz: float) -> FloatArray: ...
def move_derivative(time_s: FloatArray, values: FloatArray, moves: npt.NDArray[np.int64]) -> FloatArray: ...
def move_shifted(
    time_s: FloatArray, values: FloatArray, moves: npt.NDArray[np.int64], ahead_s: float
) -> FloatArray: ...

# reference_motion
@final
class ReferenceLog:
    def __new__(
        cls, start_s: float, step_s: float, is_valid: BoolArray, signals: FloatArray, axes: FloatArray
    ) -> ReferenceLog: ...
    def blocks(self, rate: FloatArray, time_s: FloatArray, attitude: FloatArray, block: int) -> ReferenceBlocks: ...

@final
class ReferenceBlocks:
    def without(self, lost: BoolArray) -> ReferenceBlocks: ...
    def time_s(self) -> FloatArray: ...
    def rows(self) -> npt.NDArray[np.uintp]: ...
    def angle(self) -> FloatArray: ...
    def wrt_clock(self) -> tuple[FloatArray, FloatArray]: ...
    def attitude(self) -> FloatArray: ...
    def moments(self) -> FloatArray: ...
    def normal(self, columns: FloatArray, strengths: Sequence[float]) -> ReferenceNormal: ...
    def smoothed(
        self, columns: FloatArray, strengths: Sequence[float]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...

@final
class ReferenceNormal:
    gram: FloatArray
    log_det: float
    rows: int
    innovations: FloatArray
    mean_bias: FloatArray
    cov_mean_bias: FloatArray
