"""One recording with its reference: parameters, point of linearisation, and the linear problem about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from trihedron._core import ReferenceLog
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.reference.likelihood import Problem
from trihedron.estimate.reference.together import Grid, Reference
from trihedron.gravity import EARTH_RATE_RAD_S

BLOCK_S = 1.0
"""Length of a block: gyro errors over 1 s are negligible, and a reference's slow error lasts longer."""

NUMBERS = {
    "S": 9, "gyro-g-sensitivity": 9, "quadratic": 3, "cubic": 3, "b": 3, "clock": 2, "earth": 3, "mounting": 3,
}  # fmt: skip
"""Parameters and the number of elements of each."""
SHARED = ("S", "gyro-g-sensitivity", "quadratic", "cubic")
"""Parameters of the instrument, common to all recordings."""
SIZES = {
    "gyro-g-sensitivity": np.radians(0.1) / 9.81, "quadratic": 2.5e-4, "cubic": 5e-5, "b": 0.3,
    "earth": EARTH_RATE_RAD_S / np.sqrt(3.0), "mounting": np.radians(0.3),
}  # fmt: skip
"""Prior σ. Data sheets: 0.1 °/s/g; 0.1 % of full scale at 250 °/s, in 1/(rad/s) and 1/(rad/s)². The Earth's rate has
its known length and an unknown direction; a remounted marker repeats to some tenths of a degree."""
OF_SCALE, CLOCK = 0.3, (0.1, 1e-3)
"""Prior σ of S about its initial value (relative to each scale), and of the clock's offset [s] and rate."""


@dataclass(frozen=True, eq=False)
class SlowError:
    """Slow error of a reference's attitudes at times (m,) of the log: exp(world) C exp(body), both (m, 3) [rad]."""

    time_s: FloatArray
    world: FloatArray
    body: FloatArray

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """World and body errors (n, 3) [rad] at other times; constant beyond the ends."""
        inside = np.clip(time, self.time_s[0], self.time_s[-1])
        both = CubicSpline(self.time_s, np.hstack([self.world, self.body]))(inside)
        return both[:, :3], both[:, 3:]

    def compensated(self, time: FloatArray, attitude: FloatArray) -> FloatArray:
        """Attitudes (n, 3, 3) with the slow error removed."""
        world, body = (Rotation.from_rotvec(-one).as_matrix() for one in self.at(time))
        return np.ascontiguousarray(world @ attitude @ body)


@dataclass(frozen=True, eq=False)
class Point:
    """Point of linearisation: ω = S w' + b - G f - nonlinearity ``bend``, in the reference's body rotated by
    ``mounting``; t_reference = t (1 + rate) + offset; ``slow`` is the slow error of the reference's attitudes. Blocks
    about ``lost_s`` (k,) deviate and are not used; the attitude begins anew after them.

    About attitudes with errors of degrees a constant body error and a rotation of S would differ at second order, and
    the evidence would seem to separate them.
    """

    S: FloatArray
    b: FloatArray
    offset_s: float
    rate: float
    g: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    bend: FloatArray = field(default_factory=lambda: np.zeros(6))
    mounting: FloatArray = field(default_factory=lambda: np.eye(3))
    slow: SlowError | None = None
    lost_s: FloatArray = field(default_factory=lambda: np.zeros(0))

    def deviates(self, time_s: FloatArray, block_s: float = BLOCK_S) -> BoolArray:
        """Which blocks of ``block_s`` about ``time_s`` (m,) are not used."""
        far = np.abs(time_s[:, None] - self.lost_s).min(axis=1, initial=np.inf)
        return np.asarray(far < 0.5 * max(block_s, BLOCK_S))


def without_effects(point: Point) -> Point:
    """The point with effects at 0."""
    return replace(point, g=np.zeros((3, 3)), bend=np.zeros(6))


@dataclass(frozen=True, eq=False)
class Beside:
    """A log on its grid, its reference, valid samples ``seen`` (n,), initial values ``start``, and the specific force
    (n, 3) [m/s²] in the reference's body, if known."""

    grid: Grid
    reference: Reference
    seen: BoolArray
    start: Point
    force: FloatArray | None

    @property
    def middle_s(self) -> float:
        """Time of the log at which the clock's offset is defined [s]."""
        return float(self.grid.time_s[0] + 0.5 * self.grid.step_s * len(self.grid.time_s))

    def has(self, name: str) -> bool:
        """Whether a parameter is defined with this reference."""
        motion = self.reference.motion
        is_without = {
            "clock": motion.is_stepwise,
            "earth": motion.specific_force is not None,
            "gyro-g-sensitivity": self.force is None,
        }
        return not is_without.get(name, False)

    def sigma(self, name: str, wider: Mapping[str, float]) -> FloatArray:
        """(k,) prior σ of a parameter, SI, times its factor in ``wider``."""
        by = wider.get(name, 1.0)
        if name == "S":
            return by * (OF_SCALE * np.tile(np.linalg.norm(self.start.S, axis=0), 3))
        return by * (np.array(CLOCK) if name == "clock" else np.full(NUMBERS[name], SIZES[name]))

    def values(self, point: Point, name: str) -> FloatArray:
        """Value (k,) of a parameter at a point, SI."""
        by = {
            "S": point.S.ravel(), "b": point.b, "earth": np.zeros(3), "gyro-g-sensitivity": point.g.ravel(),
            "clock": np.array([point.offset_s + point.rate * self.middle_s, point.rate]),
            "quadratic": point.bend[:3], "cubic": point.bend[3:],
            "mounting": Rotation.from_matrix(point.mounting).as_rotvec(),
        }  # fmt: skip
        return np.asarray(by[name], dtype=np.float64)

    def moved(self, point: Point, change: Mapping[str, FloatArray]) -> Point:
        """The point after changes in SI."""
        clock = change.get("clock", np.zeros(2))
        rate = float(point.rate + clock[1])
        bend = np.concatenate([change.get("quadratic", np.zeros(3)), change.get("cubic", np.zeros(3))])
        return Point(
            S=point.S + change["S"].reshape(3, 3),
            b=point.b + change["b"],
            # The clock parameter is the offset at the middle of the log.
            offset_s=float(point.offset_s + point.rate * self.middle_s + clock[0] - rate * self.middle_s),
            rate=rate,
            g=point.g + change.get("gyro-g-sensitivity", np.zeros(9)).reshape(3, 3),
            bend=point.bend + bend,
            mounting=point.mounting @ Rotation.from_rotvec(change.get("mounting", np.zeros(3))).as_matrix(),
            slow=point.slow,
            lost_s=point.lost_s,
        )

    def _own(self, point: Point) -> tuple[FloatArray, FloatArray]:
        """Rates (n, 3) along the gyro's own axes, and those axes' directions (3, 3) in columns."""
        scale = np.linalg.norm(point.S, axis=0)
        return (self.grid.gyroscope + np.linalg.solve(point.S, point.b)) * scale, point.S / scale

    def corrected(self, point: Point) -> FloatArray:
        """(n, 3) rates in the reference's body."""
        rate = self.grid.gyroscope @ point.S.T + point.b
        if self.force is not None:
            rate = rate - self.force @ point.g.T
        if np.any(point.bend):
            own, along = self._own(point)
            rate = rate - (own**2 * point.bend[:3] + own**3 * point.bend[3:]) @ along.T
        return np.ascontiguousarray(rate)

    def problem(
        self, point: Point, places: Mapping[str, IntArray], wider: Mapping[str, float], block_s: float = BLOCK_S
    ) -> Problem:
        """The linear problem about a point; ``places`` of the free parameters, factors ``wider`` on their prior σ."""
        own, along = self._own(point)
        n = len(self.grid.time_s)
        force = np.zeros((n, 0)) if self.force is None else self.force
        signals = np.ascontiguousarray(np.column_stack([self.grid.gyroscope, np.ones(n), own**2, own**3, force]))
        log = ReferenceLog(float(self.grid.time_s[0]), self.grid.step_s, self.seen, signals, along)
        time, attitude = self.attitudes(point)
        blocks = log.blocks(self.corrected(point), time, attitude, max(2, round(block_s / self.grid.step_s)))
        blocks = blocks.without(point.deviates(blocks.time_s(), block_s))
        M = blocks.moments().reshape(-1, 3, 3, signals.shape[1])
        m = len(M)
        # A reference whose timestamps are later by dτ is compared with the gyro earlier by dτ.
        clock = [-c for c in blocks.wrt_clock()]
        if self.reference.motion.attitude is None:
            # A rate is integrated over the log's time: the clock shifts rows without scaling their angles.
            clock[1] = clock[1] + np.einsum("maij,ij->ma", M[:, :, :, :3], point.S) + M[:, :, :, 3] @ point.b
        columns = {
            "S": M[:, :, :, :3].reshape(m, 3, 9),
            "b": M[:, :, :, 3],
            "clock": np.stack(clock, axis=2),
            "earth": -(blocks.time_s() - self.grid.time_s[0])[:, None, None] * np.eye(3),
            "quadratic": -np.einsum("maik,ik->mak", M[:, :, :, 4:7], along),
            "cubic": -np.einsum("maik,ik->mak", M[:, :, :, 7:10], along),
            "gyro-g-sensitivity": -M[:, :, :, 10:].reshape(m, 3, -1),
            "mounting": -blocks.attitude(),
        }
        observed = blocks.angle()
        if point.slow is not None:
            world, body = point.slow.at(blocks.time_s())
            observed = observed + world + np.einsum("mij,mj->mi", blocks.attitude(), body)
        names = list(places)
        sigma = np.concatenate([self.sigma(name, wider) for name in names])
        about = np.concatenate([self._prior(name) - self.values(point, name) for name in names])
        first = sum(NUMBERS[name] for name in names[: names.index("b")])
        return Problem(
            blocks=blocks,
            observed=observed.ravel(),
            columns=np.concatenate([columns[name] for name in names], axis=2).reshape(3 * m, -1) * sigma,
            sigma=sigma,
            centre=about / sigma,
            index=np.concatenate([places[name] for name in names]),
            bias=slice(first, first + 3),
        )

    def _prior(self, name: str) -> FloatArray:
        """Prior mean (k,) of a parameter: the initial value, and 0 for effects."""
        return self.values(without_effects(self.start), name)

    def attitudes(self, point: Point) -> tuple[FloatArray, FloatArray]:
        """Times (m,) of the log and the reference's attitudes (m, 3, 3) there; a reference rate is integrated."""
        motion = self.reference.motion
        if motion.attitude is not None:
            time, attitude = (motion.time_s - point.offset_s) / (1.0 + point.rate), motion.attitude @ point.mounting
            return time, attitude if point.slow is None else point.slow.compensated(time, attitude)
        if motion.is_stepwise:
            time = self.grid.time_s
            rate = self.reference.rate(time * (1.0 + point.rate) + point.offset_s)
        else:
            assert motion.rate is not None
            time, rate = (motion.time_s - point.offset_s) / (1.0 + point.rate), motion.rate
        return time, integrate_rate(time, rate @ point.mounting)


def places(sides: list[Beside], wanted: tuple[str, ...]) -> list[dict[str, IntArray]]:
    """Indices of each recording's parameters among all: first those of the instrument, then those per recording."""
    at, shared, out = 0, {}, []
    for name in SHARED:
        if name in wanted and any(side.has(name) for side in sides):
            shared[name] = np.arange(at, at + NUMBERS[name])
            at += NUMBERS[name]
    for k, side in enumerate(sides):
        own = {name: place for name, place in shared.items() if side.has(name)}
        for name in NUMBERS:
            if name in SHARED or name not in wanted or not side.has(name) or (name == "mounting" and k == 0):
                continue
            own[name] = np.arange(at, at + NUMBERS[name])
            at += NUMBERS[name]
        out.append(own)
    return out
