"""Poses in real recordings: how many there are, and that violent motion is none."""

import json

import numpy as np
import pytest

from trihedron.read import read_recording
from trihedron.segment import segment_recording


def test_mimu4444_poses_are_found_and_violent_rotation_gives_none(real_data):
    for device in (1, 8):
        recording = read_recording(real_data / "mimu4444" / "exp_3.npz", instance=device)
        segments = segment_recording(recording)
        steady = segments.duration_s > 15.0
        assert 19 <= steady.sum() <= 20
        gyro = recording.gyroscope
        violent = np.abs(gyro - np.median(gyro, axis=0)).max(axis=1) > 100.0 * segments.gyroscope_sigma.max()
        for pose in segments.poses:
            assert not violent[pose.start : pose.stop].any()


def test_tomi_rest_is_one_hold_that_lasts(real_data):
    recording = read_recording(real_data / "mpu6050_tomi" / "tomi_example_data_tinit_calc.csv")
    segments = segment_recording(recording)
    assert segments.n_poses == 1
    assert segments.duration_s[0] > 0.99 * recording.duration_s


@pytest.mark.parametrize("run", [2, 3])
def test_phone_holds_agree_with_the_published_sections(real_data, run):
    folder = real_data / "phone"
    published = json.loads((folder / "published_results.json").read_text())[f"static_sections_rec{run}_samples"]
    acceleration, rate = (next(folder.glob(f"rec_{run}_*{what}.csv")) for what in ("Acceleration", "AngularVelocity"))
    segments = segment_recording(read_recording(accelerometer_path=acceleration, gyroscope_path=rate))
    agreement = [
        max((min(h.stop, b) - max(h.start, a)) / (max(h.stop, b) - min(h.start, a)) for h in segments.poses)
        for a, b in published
    ]
    # Marked by hand, some with up to three seconds given away at an end; a pose of this very quiet sensor loses its
    # settling, up to a third of it.
    assert np.median(agreement) > 0.9
    assert min(agreement) > 0.6


def test_ferraris_holds_cover_the_annotated_faces_and_no_annotated_turn(real_data):
    segments = segment_recording(read_recording(real_data / "imucal_ferraris" / "example_ferraris_session.csv"))
    faces = [(540, 1271), (1620, 2361), (2814, 3298), (3740, 4152), (4522, 4975), (5376, 5983)]
    for first, last in faces:
        assert max((min(h.stop, last) - max(h.start, first)) / (last - first) for h in segments.poses) > 0.95
    for first, last in [(6770, 7093), (8081, 8405), (9205, 9512)]:
        inside = sum(max(0, min(h.stop, last) - max(h.start, first)) for h in segments.poses)
        # The turns were annotated with a little rest at their ends.
        assert inside < 0.25 * (last - first)
