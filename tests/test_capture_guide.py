"""The guide without a screen, led by a simulated hand; its screens as text."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import trihedron
from trihedron.api.guiding import conclude, examine, part_of
from trihedron.api.replaying import readings_of, steps
from trihedron.capture.guide import Guide, Stillness
from trihedron.cli import main
from trihedron.cli.screen import as_text
from trihedron.files.log import write_recording
from trihedron.records.guiding import Accuracy, Phase
from trihedron.simulate import scenario_by_name, simulate
from trihedron.simulate.motion.attitude import attitude_with_up
from trihedron.simulate.motion.steps import Motion, MoveTo, Pose
from trihedron.simulate.noise import stream

ACCURACY = Accuracy.parse("accel 0.1 %, gyro 0.2 %")


class FollowingHand:
    """Takes the instrument of ``scenario`` to a wanted pose, missing it by ``miss_deg`` rms, and holds it; moves take
    1.4 to 3 s with wobble and some travel. The noise of what was already recorded stays when the session grows."""

    def __init__(self, scenario, seed, miss_deg=8.0, first_pose_s=6.0):
        self._scenario, self._seed, self._miss = scenario, seed, np.radians(miss_deg)
        self._rng = stream(seed, "hand that follows")
        start = self._missed(np.array([0.0, 0.0, 1.0]))
        self._start = attitude_with_up(start)
        self._steps = [Pose(first_pose_s, name="pose 1")]
        self.n_poses = 1

    def go(self, up, pose_s):
        """To a pose with ``up`` (3,) of the body upwards, and hold it."""
        rng = self._rng
        x, y, z = (float(v) for v in self._missed(np.asarray(up)))
        travel = 0.1 * rng.normal(size=3)
        lasts_s, heading_deg = float(rng.uniform(1.4, 3.0)), float(rng.uniform(-120.0, 120.0))
        travel_m = (float(travel[0]), float(travel[1]), 0.3 * float(travel[2]))
        self._steps.append(MoveTo((x, y, z), lasts_s, heading_deg=heading_deg, wobble_deg=6.0, travel_m=travel_m))
        self.n_poses += 1
        # A person takes a moment to notice that it is enough.
        self._steps.append(Pose(pose_s + float(rng.uniform(0.2, 0.8)), name=f"pose {self.n_poses}"))

    def session(self):
        """Everything recorded so far, and the truth."""
        motion = Motion(tuple(self._steps), start=self._start)
        return simulate(replace(self._scenario, motion=motion), self._seed)

    def _missed(self, up):
        out = up / np.linalg.norm(up) + self._rng.normal(size=3) * self._miss / np.sqrt(2.0)
        return out / np.linalg.norm(out)


@pytest.fixture(scope="module")
def led():
    """A hand that does what the guide says, heard only through the guide's view; the session grows pose by pose."""
    scenario = scenario_by_name("hand-session")
    hand = FollowingHand(replace(scenario, clock=replace(scenario.clock, rate_hz=50.0)), 1, first_pose_s=7.5)
    state = {}

    def look():
        until = part_of(state["recording"], -np.inf, state["now"] + 1e-9)
        return examine(until, ACCURACY, gravity_m_s2=state["truth"].gravity_m_s2)

    guide = Guide(ACCURACY, look, n_checks=3)
    views, done = [], 0
    while not guide.is_done and hand.n_poses < 40:
        recording, truth = hand.session()
        state |= {"recording": recording, "truth": truth}
        readings = readings_of(recording)
        for first, last in steps(recording.time_s[done:]):
            state["now"] = float(recording.time_s[done + last - 1])
            rows = slice(done + first, done + last)
            views.append(guide.advance(recording.time_s[rows], readings[rows]))
        done = recording.n_samples
        # A second more than requested: stillness is known half a second late.
        target = guide.view().target_up
        hand.go(np.array([0.3, 0.5, 0.8]) if target is None else target, guide.view().pose_s + 1.0)
    return guide, views, state["recording"], state["truth"]


def test_a_hand_that_follows_the_guide_ends_with_the_wanted_accuracy(led):
    guide, views, recording, truth = led
    assert guide.is_done
    assert guide.examination.is_good_enough
    assert 12 <= len(guide.examination.poses_up) <= 18
    assert views[-1].n_checks == 3
    result, check = conclude(recording, guide.cut_s, gravity_m_s2=truth.gravity_m_s2)
    assert result.calibration.is_trustworthy
    # Held back: the pose of the cut and the three after it.
    assert check.segments.n_poses == 4
    assert check.verification.norm_rms < 3 * 2.5e-3
    scale = np.linalg.norm(truth.accelerometer_S, axis=0)
    assert np.allclose(np.linalg.norm(result.calibration.accelerometer.S, axis=0) / scale, 1.0, atol=3e-3)


def test_the_guide_waits_holds_moves_checks_and_ends_in_this_order(led):
    _, views, _, _ = led
    phases = [views[0].phase, *(b.phase for a, b in pairwise(views) if a.phase is not b.phase)]
    text = " ".join(phase.value for phase in phases)
    assert re.fullmatch(r"begin move( pose move)+( pose)? check done", text), text
    assert all(view.instruction for view in views)
    # Every pose rings once: poses of the calibration and of the check.
    assert views[-1].n_events == views[-1].n_poses + 3


def test_the_accuracy_is_never_said_to_be_reached_before_the_poses_tell_it():
    recording, truth = trihedron.simulate("six-faces", 0)
    state = examine(recording, ACCURACY, gravity_m_s2=truth.gravity_m_s2)
    assert not state.is_good_enough
    angles = [one for one in state.uncertain if one.sensor == "accelerometer" and one.name.startswith("angle")]
    assert all(one.now is None or one.now > 5 * one.wanted for one in angles)
    assert (state.poses_needed or 0) > 0
    # Six faces leave the angles between axes open: an edge is requested, with both its axes half up.
    assert np.sum(np.abs(state.next_up) > 0.3) >= 2


def test_of_signed_counts_with_a_large_zero_six_faces_are_told_by_the_middle_of_their_readings():
    recording, truth = trihedron.simulate("six-faces", 0)
    assert recording.accelerometer_unit.value == "counts"
    # A third of |g|; faces of a hand are within some degrees of an axis.
    off = replace(recording, accelerometer=recording.accelerometer + 5000.0)
    up = np.abs(examine(off, ACCURACY, gravity_m_s2=truth.gravity_m_s2).poses_up)
    assert up.max(axis=1).min() > 0.99


@pytest.mark.parametrize("rate_hz", [50.0, 400.0])
def test_stillness_is_seen_within_half_a_second_at_any_rate(rate_hz):
    rng = np.random.default_rng(1)
    n = int(4 * rate_hz)
    still = rng.normal(0, 0.01, (n, 6)) + 1.0
    moving = still + np.sin(np.arange(n) / rate_hz * 6.0)[:, None]
    watch = Stillness()
    seen = []
    for i, part in enumerate((still, moving, still)):
        for k in range(0, n, 10):
            watch.add((i * n + k + np.arange(min(10, n - k))) / rate_hz, part[k : k + 10])
            seen.append(watch.still_for_s > 0.0)
    share = np.array(seen).reshape(3, -1)
    late = int(np.ceil(0.6 * rate_hz / 10))
    assert share[0, late:].all()
    assert not share[1, late:].any()
    assert share[2, late:].all()


@pytest.mark.parametrize("text", ["accel 0.05", "mag 1 %", "accel 50 %", "accel -1 %", "accel . %"])
def test_an_accuracy_that_is_not_understood_is_refused(text):
    with pytest.raises(ValueError, match="is not understood; write for example"):
        Accuracy.parse(text)


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40)])
def test_the_screen_fits_the_terminal_and_says_what_matters(led, width, height):
    _, views, _, _ = led
    for view in (views[0], next(v for v in views if v.phase is Phase.MOVE and v.n_poses > 9), views[-1]):
        lines = as_text(view, width, height).rstrip("\n").split("\n")
        assert len(lines) <= height
        assert max(len(line) for line in lines) <= width
        assert view.instruction[:40] in lines[1]
        assert "…" not in "".join(lines[3:])
    assert "uncertainty" in "\n".join(lines)


def test_a_log_is_replayed_through_the_guide_to_a_calibration(led, tmp_path, capsys):
    _, _, recording, truth = led
    log, calibration = tmp_path / "log.csv", tmp_path / "cal.json"
    write_recording(recording, log)
    assert main(["guide", str(log), "--gravity", f"{truth.gravity_m_s2}", "-o", str(calibration)]) == 0
    said = capsys.readouterr().out
    assert "Accuracy reached. 3 more poses to check it." in " ".join(said.split())
    assert "Verification" in said
    assert trihedron.read_calibration(calibration).is_trustworthy
