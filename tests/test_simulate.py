"""A simulated recording is the linear instrument plus what is switched on, and nothing else changes with it."""

from dataclasses import replace

import numpy as np

from trihedron.simulate import NoiseTerms, list_scenarios, scenario_by_name, simulate


def test_without_noise_the_direct_form_returns_the_truth():
    recording, truth = simulate(scenario_by_name("linear-noiseless"), seed=4)
    f = recording.accelerometer @ truth.accelerometer_S.T + truth.accelerometer_b
    w = recording.gyroscope @ truth.gyroscope_S.T + truth.gyroscope_b
    # 16-bit counts of 1e-16 relative: 20 m/s² · 1e-15.
    assert np.abs(f - truth.specific_force_m_s2).max() < 1e-12
    assert np.abs(w - truth.angular_rate_rad_s).max() < 1e-12


def test_switching_one_term_leaves_every_other_sample_by_sample():
    scenario = scenario_by_name("linear-noiseless")
    noisy = replace(scenario, gyroscope=replace(scenario.gyroscope, noise=NoiseTerms(N=(1e-4, 0, 0))))
    plain, _ = simulate(scenario, seed=1)
    changed, _ = simulate(noisy, seed=1)
    assert np.array_equal(plain.accelerometer, changed.accelerometer)
    assert np.array_equal(plain.gyroscope[:, 1:], changed.gyroscope[:, 1:])
    assert not np.array_equal(plain.gyroscope[:, 0], changed.gyroscope[:, 0])


def test_labels_cover_the_recording_and_holds_stand_still():
    recording, truth = simulate(scenario_by_name("hand-session"), seed=2)
    assert truth.segments[0].start == 0
    assert truth.segments[-1].stop == recording.n_samples
    for before, after in zip(truth.segments, truth.segments[1:], strict=False):
        assert before.stop == after.start
    for pose in truth.poses:
        assert not truth.angular_rate_rad_s[pose.start : pose.stop].any()


def test_every_named_scenario_says_what_it_is():
    for name, sentence in list_scenarios().items():
        assert scenario_by_name(name).name == name
        assert sentence.endswith(".")
