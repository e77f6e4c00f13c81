"""A guided calibration as a state machine without a screen: readings in, instructions out.

It contains no estimator: ``examine`` returns the state of the session (poses, uncertainties, the most useful next pose)
and is called once per pose. The caller passes the real one (``trihedron.api.guiding``) or a substitute.
"""

import math
from collections.abc import Callable
from itertools import product

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.records.guiding import Accuracy, Examination, GuideView, Phase
from trihedron.records.segments import LEAST_POSE_S
from trihedron.transforms import directions_of

Examine = Callable[[], Examination]

FIRST_POSE_S = 6.0
"""The first pose is longer because it also measures the noise."""

SAME_POSE_DEG = 15.0
N_CHECKS = 3
MOST_POSES = 60
"""Poses after which to stop although the accuracy is not reached."""
RETRY_POSE_S = 2.0


class Guide:
    """Guides a session: pose, move to the most useful pose, until the accuracy is reached; then poses to verify it.

    ``examine`` returns the state of the session from everything recorded so far; ``n_checks`` verification poses are
    excluded from the calibration.
    """

    def __init__(self, accuracy: Accuracy, examine: Examine, *, n_checks: int = N_CHECKS) -> None:
        self.accuracy = accuracy
        self.phase = Phase.BEGIN
        self.examination: Examination | None = None
        self.cut_s: float | None = None
        """Time [s] at which the data of the calibration end and the verification poses begin; None until then."""
        self._examine = examine
        self._n_checks = n_checks
        self._stillness = Stillness()
        self._time_s = 0.0
        self._is_taken = False
        self._here = Orientation()
        self._asked_s = FIRST_POSE_S
        self._taken_up: FloatArray | None = None
        self._checks: list[FloatArray] = []
        self._target: FloatArray | None = None
        self._events = 0
        self._remark = ""

    @property
    def is_done(self) -> bool:
        """Whether the session is complete."""
        return self.phase is Phase.DONE

    def advance(self, time_s: FloatArray, readings: FloatArray) -> GuideView:
        """Process readings (n, 3) or (n, 6), accelerometer first, at ``time_s`` (n,) [s]; return what to show."""
        if len(time_s) and not self.is_done:
            self._stillness.add(time_s, readings)
            self._time_s = float(time_s[-1])
            self._step()
        return self.view()

    def view(self) -> GuideView:
        """What to show now."""
        instruction, detail = self._words()
        warnings = self.examination.warnings if self.examination else ()
        if self._stillness.is_shaky and self._stillness.still_for_s > 1.0:
            warnings = ("The board trembles: put it on something firm, hands off, away from fans.", *warnings)
        if self._remark:
            warnings = (self._remark, *warnings)
        return GuideView(
            phase=self.phase,
            instruction=instruction,
            detail=detail,
            is_still=self._stillness.still_for_s > 0.0,
            held_s=self._stillness.still_for_s,
            pose_s=self._asked_s,
            n_poses=0 if self.examination is None else len(self.examination.poses_up),
            n_checks=len(self._checks),
            up_now=self._up(),
            examination=self.examination,
            target_up=self._target,
            warnings=warnings,
            time_s=self._time_s,
            accuracy=self.accuracy,
            n_events=self._events,
        )

    def finish(self) -> GuideView:
        """Count a pose that the end of the readings left unfinished; return what to show."""
        if not self.is_done and self._here.is_uncounted:
            self._take_left()
        return self.view()

    def _step(self) -> None:
        still_s = self._stillness.still_for_s
        if self._here.is_over(self._stillness) and self._here.is_uncounted:
            self._take_left()
        self._here.add(self._stillness)
        if self._is_taken and not self._has_moved():
            return
        self._is_taken = False
        if still_s <= 0.0:
            if self.phase is Phase.POSE:
                self.phase = Phase.MOVE
                self._asked_s = self._usual_s()  # a longer duration requested for the pose just left ends with it
            return
        if self.phase is Phase.MOVE:
            self.phase = Phase.POSE
        if still_s >= self._asked_s:
            self._take()

    def _take_left(self) -> None:
        """Count a pose that was left before the time requested for it, if the segmentation finds it."""
        if self.phase is Phase.CHECK:
            return
        examination = self._examine()
        if len(examination.poses_up) > (0 if self.examination is None else len(self.examination.poses_up)):
            self.examination, self._asked_s, self._remark = examination, examination.pose_s, ""
            self._events += 1
            self._go_on(examination)

    def _has_moved(self) -> bool:
        up = self._up()
        if up is None or self._taken_up is None:
            return True
        return float(np.degrees(np.arccos(np.clip(up @ self._taken_up, -1.0, 1.0)))) > MOVED_DEG

    def _take(self) -> None:
        """The pose has lasted long enough: examine the session, accept the pose or not, and choose what is next."""
        if self.phase is Phase.CHECK:
            self._take_check()
            return
        before = 0 if self.examination is None else len(self.examination.poses_up)
        examination = self._examine()
        self.examination = examination
        self._asked_s = examination.pose_s
        if len(examination.poses_up) <= before and before:
            self._remark = "This pose is not long enough yet: hands off."
            self._asked_s = self._stillness.still_for_s + RETRY_POSE_S
            if self._stillness.still_for_s > 3.0 * examination.pose_s:
                self._remark = "This pose was counted before: turn the board on."
                self._accepted()
            return
        self._remark = ""
        if before and self._is_repeat(examination):
            self._remark = "The board lies almost as in an earlier pose: turn it to the marked one to learn more."
        self._accepted()
        self._go_on(examination)

    def _go_on(self, examination: Examination) -> None:
        """The next pose, or the poses to verify with."""
        is_last = len(examination.poses_up) >= MOST_POSES
        if not (examination.is_good_enough or is_last):
            self._target, self.phase = examination.next_up, Phase.MOVE
            return
        if not examination.is_good_enough:
            self._remark = f"{MOST_POSES} poses and the accuracy is not reached: see the warnings for the cause."
        self.cut_s = self._time_s
        self.phase = Phase.CHECK if self._n_checks else Phase.DONE
        self._target = self._far_from_all()

    def _accepted(self) -> None:
        self._is_taken = self._here.is_counted = True
        self._events += 1
        self._taken_up = self._up()

    def _is_repeat(self, examination: Examination) -> bool:
        *earlier, last = examination.poses_up
        return bool(earlier) and bool(np.max(np.array(earlier) @ last) > np.cos(np.radians(SAME_POSE_DEG)))

    def _take_check(self) -> None:
        up = self._up()
        if up is not None:
            self._checks.append(up)
        self._accepted()
        self._asked_s = self._usual_s()
        if len(self._checks) >= self._n_checks:
            self.phase, self._target = Phase.DONE, None
        else:
            self._target = self._far_from_all()

    def _usual_s(self) -> float:
        return FIRST_POSE_S if self.examination is None else self.examination.pose_s

    def _far_from_all(self) -> FloatArray:
        """The face, edge or corner direction farthest from every pose: the strictest verification of a calibration."""
        grid = np.array([direction for direction in product((-1.0, 0.0, 1.0), repeat=3) if any(direction)])
        unit: FloatArray = directions_of(grid)
        known = [] if self.examination is None else list(self.examination.poses_up)
        seen = [*known, *self._checks] or [np.array([0.0, 0.0, 1.0])]
        out: FloatArray = unit[int(np.argmin((unit @ np.array(seen).T).max(axis=1)))]
        return out

    def _up(self) -> FloatArray | None:
        mean, known = self._stillness.mean, self.examination
        if mean is None or known is None:
            return None
        up: FloatArray = known.matrix @ (mean[:3] - known.centre)
        length = float(np.linalg.norm(up))
        return up / length if length > 0.0 else None

    def _words(self) -> tuple[str, str]:
        left = max(self._asked_s - self._stillness.still_for_s, 0.0)
        if self.phase is Phase.DONE:
            return "Done.", "The calibration and its check follow."
        if self.phase is Phase.BEGIN:
            if self._stillness.still_for_s > 0.0:
                return f"Hold still: {left:.0f} s", "The first pose measures the noise of the board."
            return "Put the board down and take your hands off.", "Anything firm will do; it need not be level."
        if self._is_taken or self._stillness.still_for_s <= 0.0:
            return self._where_to()
        return f"Hold still: {left:.0f} s", "Hands off; a word and a beep say when it is enough."

    def _where_to(self) -> tuple[str, str]:
        known = self.examination
        if self.phase is Phase.CHECK:
            n = self._n_checks - len(self._checks)
            more = f"{n} more poses" if n > 1 else "One more pose"
            return f"Accuracy reached. {more} to check it.", "Any pose far from the others."
        if known is None:
            return "Turn the board to another side.", ""
        return f"Turn: {known.next_words}.", known.why


# Immediate detection of stillness: the standard deviation over ``WINDOW_S`` against the lowest so far. The segmentation
# of the whole log decides later which poses count; this one only drives the display.

MOVED_DEG = 8.0
"""Smallest change of direction that is another orientation."""

WINDOW_S = 0.25
LOUDER = 3.0
"""Limit of a window's standard deviation over the calm one: noise exceeds it in < 10⁻⁶ of windows (25 rows, 6 axes)."""

MEAN_SHIFT = 2.5
"""Limit of the change of mean between windows over the calm standard deviation; noise of a mean is a fifth of it."""

CALM_QUANTILE = 0.1
SHAKY = 1.8
"""A window's standard deviation over the calm one above which a static board is on a vibrating table, or held."""


class Stillness:
    """Detects stillness from readings as they arrive; :attr:`still_for_s` is how long the board has been static."""

    def __init__(self) -> None:
        self.still_for_s = 0.0
        self.mean: FloatArray | None = None
        self.is_shaky = False
        self._rows: list[FloatArray] = []
        self._since_s: float | None = None
        self._spreads: list[FloatArray] = []
        self._before: FloatArray | None = None
        self._still_from_s: float | None = None

    def add(self, time_s: FloatArray, readings: FloatArray) -> None:
        """Add readings (n, 3) or (n, 6) at ``time_s`` (n,) [s]."""
        start = 0
        for i, t in enumerate(time_s):
            if self._since_s is None:
                self._since_s = float(t)
            if t - self._since_s >= WINDOW_S:
                self._rows.append(readings[start:i])
                self._window(float(t))
                start, self._since_s = i, float(t)
        self._rows.append(readings[start:])

    def _window(self, end_s: float) -> None:
        rows = np.concatenate(self._rows)
        self._rows = []
        if len(rows) < 3 or not np.all(np.isfinite(rows)):
            return
        mean, spread = rows.mean(axis=0), rows.std(axis=0)
        self._spreads.append(spread)
        if len(self._spreads) > 4000:
            del self._spreads[::2]
        calm = np.quantile(np.array(self._spreads), CALM_QUANTILE, axis=0)
        # With a coarse ADC the standard deviation in a pose may be 0.
        calm = np.maximum(calm, 0.05 * np.median(np.array(self._spreads), axis=0) + 1e-12)
        is_still = bool(np.all(spread <= LOUDER * calm + _step(rows)))
        if self._before is not None:
            is_still &= bool(np.all(np.abs(mean - self._before) <= MEAN_SHIFT * calm + _step(rows)))
        self.is_shaky = is_still and bool(np.any(spread > SHAKY * calm + _step(rows)))
        self._before, self.mean = mean, mean
        if not is_still:
            self._still_from_s = None
            self.still_for_s = 0.0
            return
        if self._still_from_s is None:
            self._still_from_s = end_s - WINDOW_S
        self.still_for_s = end_s - self._still_from_s


class Orientation:
    """Static time in the present orientation: a tremble does not end it, a turn does."""

    def __init__(self) -> None:
        self.is_counted = False
        self._static_s = self._before_s = 0.0
        self._mean: FloatArray | None = None

    @property
    def is_uncounted(self) -> bool:
        """Whether it lasted long enough for a pose and was not counted."""
        return self._static_s >= LEAST_POSE_S and not self.is_counted

    def is_over(self, stillness: Stillness) -> bool:
        """Whether the board is static in another orientation."""
        if stillness.still_for_s <= 0.0 or stillness.mean is None or self._mean is None:
            return False
        a, b = self._mean[:3], stillness.mean[:3]
        cosine = float(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), TINY)
        return cosine < math.cos(math.radians(MOVED_DEG))

    def add(self, stillness: Stillness) -> None:
        """Add the time that has passed since the last call."""
        if self._mean is None or self.is_over(stillness):
            self.is_counted, self._static_s, self._before_s = False, 0.0, 0.0
            self._mean = stillness.mean if stillness.still_for_s > 0.0 else None
        more = stillness.still_for_s - self._before_s
        self._static_s += more if more >= 0.0 else stillness.still_for_s
        self._before_s = stillness.still_for_s


def _step(rows: FloatArray) -> FloatArray:
    """(k,) allowance per axis: 1 LSB where readings are whole numbers, else 0."""
    whole = np.all(rows == np.round(rows), axis=0)
    return np.where(whole, 1.0, 0.0)
