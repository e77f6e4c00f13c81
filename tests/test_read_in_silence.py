"""What would be read wrong without a word: clocks that count, two devices in a stream, swapped axes, unknown units."""

import numpy as np
import pytest

from hand_made_sessions import G, motion
from trihedron.read import ReadError, read_recording
from trihedron.records import Severity
from trihedron.units import AccelerationUnit, RateUnit

HEADER = "t,ax,ay,az,gx,gy,gz"
STATED = [
    ("", " [g0]", "", G, 1.0, "g", "rad/s"),
    ("", " [mg]", " (mdps)", 1e-3 * G, np.pi / 180e3, "mg", "mdeg/s"),
    ("", " [Gal]", " (rpm)", 1e-2, np.pi / 30, "cm/s^2", "rpm"),
    ("", " [cm/s^2]", " (°/h)", 1e-2, np.pi / 648000, "cm/s^2", "deg/h"),
    ("", " [m/s2]", " (LSB)", 1.0, 1.0, "m/s^2", "counts"),
    ("# acceleration in cm/s^2, angular rate in deg/h\n", "", "", 1e-2, np.pi / 648000, "cm/s^2", "deg/h"),
    ("# accelerometer unit: cm/s2, gyroscope unit: deg/h\n", "", "", 1e-2, np.pi / 648000, "cm/s^2", "deg/h"),
    ("# Accel [cm/s²]\n# Gyro [°/h]\n", "", "", 1e-2, np.pi / 648000, "cm/s^2", "deg/h"),
    ("# accelerometer: Gal; gyro: dph\n", "", "", 1e-2, np.pi / 648000, "cm/s^2", "deg/h"),
    # Of the readings these state no unit.
    ("# the accelerometer was mounted in the lab\n", "", "", 1.0, 1.0, "m/s^2", "rad/s"),
    ("# accelerometer range: 4 g, gyro range: 500 dps\n", "", "", 1.0, 1.0, "m/s^2", "rad/s"),
]


def written(path, *columns, header=HEADER, remark=""):
    body = "\n".join(
        ",".join(f"{x:.7g}" if isinstance(x, float) else str(x) for x in row) for row in zip(*columns, strict=True)
    )
    path.write_text(f"{remark}{header}\n{body}\n")
    return path


def table(timestamps, force, rate):
    return (list(timestamps), *(list(map(float, c)) for c in (*force.T, *rate.T)))


def serious(recording):
    return {f.code for f in recording.findings if f.severity is Severity.SERIOUS}


@pytest.mark.parametrize(
    ("rate_hz", "first", "tick_s", "unit", "factor"),
    [
        (100.0, 0, 1 / 32768, "", np.pi / 180),
        (100.0, 0, 1 / 32768, " [dps]", np.pi / 180),
        (100.0, 0, 1 / 32768, " [LSB]", np.pi / 180 / 16.4),
        # Taken for ms they run 16 times too slow: deg/s then look like mrad/s that are 9 % off.
        (400.0, 64_400_234, 62.5e-6, "", np.pi / 180),
    ],
)
def test_ticks_of_an_unknown_size_are_asked_for(tmp_path, rate_hz, first, tick_s, unit, factor):
    t, force, rate = motion(rate_hz)
    rate = np.rint(rate / factor) if "LSB" in unit else rate / factor
    header = f"{'ticks' if first == 0 else 't'},ax,ay,az,gx{unit},gy{unit},gz{unit}"
    log = written(tmp_path / "log.csv", *table([first + round(x / tick_s) for x in t], force, rate), header=header)
    assert serious(read_recording(log)) & {"time-unit-detected", "unit-contradicted"}
    said = read_recording(log, time_unit=f"{tick_s * 1e6!r} us")
    assert said.rate_hz == pytest.approx(rate_hz, rel=1e-4)
    assert said.gyroscope_unit is (RateUnit.COUNTS if "LSB" in unit else RateUnit.DEG_S)
    assert not serious(said)


def test_a_doubtful_clock_is_settled_by_a_stated_gyro_unit_that_gravity_agrees_with(tmp_path):
    t, force, rate = motion(1000.0, n_poses=4)
    timestamps = [round(x * 1e3) for x in t]
    header = "t,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]"
    told = read_recording(written(tmp_path / "log.csv", *table(timestamps, force, rate), header=header))
    assert told.rate_hz == pytest.approx(1000.0)
    assert not serious(told)
    untold = read_recording(written(tmp_path / "log.csv", *table(timestamps, force, rate)))
    assert "time-unit-detected" in serious(untold)


@pytest.mark.parametrize("remark", ["# sampling rate: 100 Hz\n", ""])
def test_a_counter_under_the_name_of_a_time_runs_at_the_rate_that_is_told_and_tells_losses(tmp_path, remark):
    t, force, rate = motion()
    kept = np.delete(np.arange(len(t)), [500, 501, 502])
    log = written(tmp_path / "log.csv", *table([int(k) for k in kept], force[kept], rate[kept]), remark=remark)
    recording = read_recording(log, rate_hz=None if remark else 100.0)
    assert recording.rate_hz == pytest.approx(100.0)
    assert np.diff(recording.time_s).max() == pytest.approx(0.04)


def test_turns_about_the_vertical_do_not_make_a_gyro_look_slow(tmp_path):
    t, force, rate = motion()
    # Spun about the vertical for most of the log, between the poses.
    up = force / np.linalg.norm(force, axis=1)[:, None]
    rate = rate + 3.0 * np.sin(2 * np.pi * t / 3.0)[:, None] * up
    recording = read_recording(written(tmp_path / "log.csv", *table([f"{x:.3f}" for x in t], force, rate)))
    assert recording.gyroscope_unit is RateUnit.RAD_S
    assert not serious(recording)


def header_of(accelerometer, gyro):
    return "t_s," + ",".join([f"a{a}{accelerometer}" for a in "xyz"] + [f"g{a}{gyro}" for a in "xyz"])


@pytest.mark.parametrize(("remark", "accel", "gyro", "in_si", "in_rad_s", "accel_unit", "gyro_unit"), STATED)
def test_units_that_a_name_or_a_remark_states_are_obeyed(
    tmp_path, remark, accel, gyro, in_si, in_rad_s, accel_unit, gyro_unit
):
    t, force, rate = motion(n_poses=3)
    columns = table(t, force / in_si, rate / in_rad_s)
    recording = read_recording(written(tmp_path / "log.csv", *columns, header=header_of(accel, gyro), remark=remark))
    assert recording.accelerometer_unit is AccelerationUnit(accel_unit)
    assert recording.gyroscope_unit is RateUnit(gyro_unit)
    assert not serious(recording)


@pytest.mark.parametrize(
    ("accel", "gyro", "complaint"),
    [
        (" [ft/s^2]", "", r"'ft/s.2'.*--accel-unit"),
        (" [1/s]", "", r"'1/s'.*--accel-unit"),
        # Not taken by its beginning.
        ("", " [rad/min]", r"'rad/min'.*--gyro-unit"),
        ("", "_rev/s", r"'rev/s'.*--gyro-unit"),
    ],
)
def test_a_unit_that_nobody_knows_is_asked_for_by_name(tmp_path, accel, gyro, complaint):
    log = written(tmp_path / "log.csv", *table(*motion(n_poses=3)), header=header_of(accel, gyro))
    with pytest.raises(ReadError, match=complaint):
        read_recording(log)
    said = read_recording(log, accelerometer_unit="m/s^2", gyroscope_unit="rad/s")
    assert (said.accelerometer_unit, said.gyroscope_unit) == (AccelerationUnit.M_S2, RateUnit.RAD_S)


@pytest.mark.parametrize("same_timestamps", [True, False])
def test_two_devices_row_by_row_are_asked_for_whatever_the_column_is_called(tmp_path, same_timestamps):
    t, *first = motion(seed=1)
    _, *second = motion(seed=2)
    force, rate = (np.stack(pair, axis=1).reshape(-1, 3) for pair in zip(first, second, strict=True))
    timestamps = np.stack([t, t if same_timestamps else t + 0.005], axis=1).ravel()
    which = [k % 2 for k in range(len(timestamps))]
    log = written(tmp_path / "log.csv", *table(timestamps, force, rate), which, header=f"{HEADER},whose")
    with pytest.raises(ReadError, match="'whose' identifies 2 devices"):
        read_recording(log)
    recording = read_recording(log, instance=1)
    np.testing.assert_allclose(recording.accelerometer, second[0], atol=1e-5)
    bare = read_recording(written(tmp_path / "bare.csv", *table(timestamps, force, rate)))
    assert "devices-interleaved" in serious(bare)


@pytest.mark.parametrize("every", [2, 4])
def test_mains_hum_near_a_fraction_of_the_sampling_rate_is_one_device_and_a_rigid_pair_two(tmp_path, every):
    t, force, rate = motion(n_poses=12)
    noise = np.random.default_rng(4).standard_normal((2, *force.shape))
    frequency_hz = 1.0 / every / np.median(np.diff(t)) + 0.02
    hum = 0.15 * np.sin(2.0 * np.pi * frequency_hz * t)[:, None] * [1.0, -0.5, 0.8]
    recording = read_recording(written(tmp_path / "hum.csv", *table(t, force + hum + 0.02 * noise[0], rate)))
    assert "devices-interleaved" not in serious(recording)
    # Of one kind, side by side on a board: they differ by bias and scale alone.
    pair = np.where(np.arange(len(t))[:, None] % every == 0, 1.01 * force + 0.15, force) + 0.02 * noise[1]
    recording = read_recording(written(tmp_path / "pair.csv", *table(t, pair, rate)))
    assert "devices-interleaved" in serious(recording)


@pytest.mark.parametrize("kind", [-0.5, 0.9, "toggles"])
def test_noise_that_alternates_and_readings_that_toggle_between_two_steps_are_one_device(tmp_path, kind):
    t, force, rate = motion()
    if kind == "toggles":
        force = 0.1 * np.rint(force / 0.1) + 0.1 * (np.arange(len(t)) % 2)[:, None]
    else:
        noise = np.random.default_rng(3).standard_normal(force.shape)
        for k in range(1, len(noise)):
            noise[k] += kind * noise[k - 1]
        force = force + 0.03 * noise
    recording = read_recording(written(tmp_path / "log.csv", *table(t, force, rate)))
    assert "devices-interleaved" not in serious(recording)


def test_axes_of_both_sensors_that_turn_while_the_part_rests_are_serious(tmp_path):
    t, force, rate = motion(n_poses=16)
    # Poses of two seconds every 3.2 s or so: the first row, from a third of the log on, in the middle of one.
    at = next(k for k in range(len(t) // 3, len(t)) if np.abs(rate[k - 50 : k + 50]).max() < 0.05)
    turned = [array.copy() for array in (force, rate)]
    for array in turned:
        array[at:] = array[at:, [1, 0, 2]] * [1, -1, 1]
    recording = read_recording(written(tmp_path / "log.csv", *table(t, *turned)))
    (found,) = [f for f in recording.findings if f.severity is Severity.SERIOUS]
    assert (found.code, found.numbers["sample"]) == ("axes-changed", at)
    # A pause in which the part was turned is a gap, and a blow is over at once.
    later = np.where(np.arange(len(t)) < at, t, t + 3.0)
    recording = read_recording(written(tmp_path / "gap.csv", *table(later, *turned)))
    assert "axes-changed" not in serious(recording)
    force[at] += 15.0
    assert not serious(read_recording(written(tmp_path / "blow.csv", *table(t, force, rate))))


@pytest.mark.parametrize("is_true", [True, False])
def test_a_clock_that_changes_its_rate_is_serious_unless_gravity_turns_so_too(tmp_path, is_true):
    t, force, rate = motion(n_poses=16)
    half = len(t) // 2
    # At half the rate from there on: every second sample is lost, and its turn is not.
    kept = np.r_[:half, half : len(t) : 2]
    assert not serious(read_recording(written(tmp_path / "kept.csv", *table(t[kept], force[kept], rate[kept]))))
    timestamps = np.where(t < t[half], t, t[half] + 1.25 * (t - t[half]))
    if is_true:
        rate[half:] /= 1.25
    recording = read_recording(written(tmp_path / "log.csv", *table(timestamps, force, rate)))
    assert ("clock-jumped" in serious(recording)) is not is_true
    # The scale by gravity changed by the ratio of the rates: that decides it.
    assert is_true or any("turns as if it had not" in found.seen for found in recording.findings)


@pytest.mark.parametrize(("name", "per_s"), [("dt_us", 1e6), ("Delta time [ms]", 1e3), ("dt", 1.0)])
def test_the_time_since_the_row_before_is_summed(tmp_path, name, per_s):
    t, force, rate = motion(rate_hz=128.0)
    steps = np.diff(np.rint(t * 1e6), prepend=-7812.0) * 1e-6
    steps[400] += 3.0
    log = written(tmp_path / "log.csv", *table(steps * per_s, force, rate), header=HEADER.replace("t,", f"{name},", 1))
    recording = read_recording(log)
    assert "rate-assumed" not in {f.code for f in recording.findings}
    assert recording.rate_hz == pytest.approx(128.0, rel=1e-3)
    assert recording.time_s[-1] == pytest.approx(t[-1] - t[0] + 3.0, abs=0.01)


@pytest.mark.parametrize("bracket", ["[0.061 mg/LSB]", "[mg/digit]", "[1/16384 g]", "[+-2 g]"])
def test_the_size_of_a_count_or_a_range_in_a_name_is_no_unit_of_the_readings(tmp_path, bracket):
    t, force, rate = motion()
    columns = (list(t), *(np.rint(c / G * 16384).astype(int).tolist() for c in force.T), *map(list, rate.T))
    names = ",".join(f"a{a} {bracket}" for a in "xyz")
    recording = read_recording(written(tmp_path / "log.csv", *columns, header=f"t,{names},gx,gy,gz"))
    assert recording.accelerometer_unit is AccelerationUnit.COUNTS
    assert not serious(recording)


@pytest.mark.parametrize(("offset_s", "burst"), [(0.0, 1), (0.005, 10)])
def test_devices_that_no_column_tells_apart_are_split_by_their_turn_where_no_row_is_missing(tmp_path, offset_s, burst):
    t, *first = motion(seed=1)
    _, *second = motion(seed=2)
    rows = [np.column_stack([t, *first]), np.column_stack([t + offset_s, *second])]
    both = np.stack([r.reshape(-1, burst, 7) for r in rows], axis=1).reshape(-1, 7)
    log = written(tmp_path / "log.csv", *both.T.tolist())
    assert "devices-interleaved" in serious(read_recording(log))
    recording = read_recording(log, instance=2)
    np.testing.assert_allclose(recording.accelerometer, second[0], atol=1e-5)
    assert not serious(recording)
    with pytest.raises(ReadError, match="some are missing"):
        read_recording(written(tmp_path / "lost.csv", *np.delete(both, 2000, axis=0).T.tolist()), instance=2)
