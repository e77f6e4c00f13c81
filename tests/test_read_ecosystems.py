"""Bags, ULog, DataFlash, HDF5 and MATLAB files, written by their ecosystem or byte by byte after its specification."""

import struct
import sys

import numpy as np
import pytest
from scipy.io import savemat

import trihedron
from test_read import readings
from trihedron.read import ReadError, read_recording
from trihedron.units import AccelerationUnit, RateUnit

TABLE = readings(300)
XYZ = "float x;float y;float z;float temperature;"
REAL = {
    "sparkfun_razor.bag": ("rosbags", {}, 2144, 69.0),
    "sample_log_small.ulg": ("pyulog", {}, 1298, 204.6),
    "ardupilot_log171.bin": ("pymavlink", {"instance": 2}, 11916, 49.6),
}


def assert_same(recording, table=TABLE, atol=0.0) -> None:
    np.testing.assert_allclose(recording.accelerometer, table[:, 1:4], rtol=0, atol=atol)
    np.testing.assert_allclose(recording.gyroscope, table[:, 4:], rtol=0, atol=atol)
    np.testing.assert_allclose(recording.time_s, table[:, 0], rtol=0, atol=1e-6)
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    assert recording.gyroscope_unit is RateUnit.RAD_S
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported


def write_bag(path, topics, *, kind, n_written=None):
    """A bag with one topic of sensor_msgs/Imu for each table, by rosbags' own writers."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags (trihedron[ros]) is not installed")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if kind == "ros1" else typesys.Stores.ROS2_HUMBLE)
    types = store.types
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    imu, vector = types["sensor_msgs/msg/Imu"], types["geometry_msgs/msg/Vector3"]
    turned = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    if kind == "ros1":
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer(path, version=9, storage_plugin=plugin)
    with writer:
        for topic, table in topics.items():
            connection = writer.add_connection(topic, "sensor_msgs/msg/Imu", typestore=store)
            for k, row in enumerate(table[:n_written]):
                ns = 1_709_294_400_000_000_000 + round(row[0] * 1e9)
                sec, nanosec = divmod(ns, 10**9)
                extra = {"seq": k} if kind == "ros1" else {}
                message = imu(
                    header=header(stamp=stamp(sec=sec, nanosec=nanosec), frame_id="imu", **extra),
                    orientation=turned,
                    orientation_covariance=np.zeros(9),
                    angular_velocity=vector(*map(float, row[4:7])),
                    angular_velocity_covariance=np.zeros(9),
                    linear_acceleration=vector(*map(float, row[1:4])),
                    linear_acceleration_covariance=np.zeros(9),
                )
                raw = (store.serialize_ros1 if kind == "ros1" else store.serialize_cdr)(message, imu.__msgtype__)
                writer.write(connection, ns + 2_000_000, raw)
    return path


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_a_bag_gives_the_readings_on_the_clock_of_its_headers(tmp_path, kind):
    path = write_bag(tmp_path / ("log.bag" if kind == "ros1" else "log"), {"/imu": TABLE}, kind=kind)
    assert_same(read_recording(path))
    if kind != "ros1":
        (inner,) = [p for p in path.iterdir() if p.suffix in (".db3", ".mcap")]
        renamed = inner.rename(tmp_path / "whatever.bin")
        if kind == "mcap":
            # A .db3 without its metadata does not describe its messages' types in every version.
            assert_same(read_recording(renamed))


def test_topics_of_a_bag_are_listed_with_counts_and_chosen(tmp_path):
    other = TABLE.copy()
    other[:, 1:4] += 1.0
    path = write_bag(tmp_path / "log.bag", {"/front/imu": TABLE, "/rear/imu": other[:200]}, kind="ros1")
    listed = r"/front/imu \(300 messages\), /rear/imu \(200 messages\); .*--topic /front/imu"
    with pytest.raises(ReadError, match=listed):
        read_recording(path)
    assert_same(read_recording(path, topic="/front/imu"))
    assert read_recording(path, topic="rear/imu").n_samples == 200
    with pytest.raises(ReadError, match="there is no topic /imu in this bag"):
        read_recording(path, topic="/imu")


def test_a_camera_that_logs_each_sensor_by_itself_is_merged(tmp_path):
    acc, gyr = TABLE.copy(), TABLE.copy()
    acc[:, 4:] = 0.0
    gyr[:, 1:4] = 0.0
    path = write_bag(tmp_path / "log.bag", {"/camera/accel/sample": acc, "/camera/gyro/sample": gyr}, kind="ros1")
    assert_same(read_recording(path))


def ulog(topics: dict[tuple[str, int], tuple[str, list[bytes]]]) -> bytes:
    """A ULog file after PX4's file format document: header, flags, formats, subscriptions, data."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    for name, fields in {name: fields for (name, _), (fields, _) in topics.items()}.items():
        out += message(b"F", f"{name}:uint64_t timestamp;{fields}".encode())
    for k, ((name, instance), (_, bodies)) in enumerate(topics.items()):
        out += message(b"A", struct.pack("<BH", instance, k) + name.encode())
        out += b"".join(message(b"D", struct.pack("<H", k) + body) for body in bodies)
    return out


def rows_of(us, columns):
    return [struct.pack(f"<Q{len(columns)}f", int(t), *map(float, row)) for t, *row in zip(us, *columns, strict=True)]


def raw_topics(instance, table):
    us = 5_000_000 + np.rint(1e6 * table[:, 0])
    warm = np.full(len(table), 45.0)
    return {
        ("sensor_accel", instance): (XYZ, rows_of(us, [*table[:, 1:4].T, warm])),
        ("sensor_gyro", instance): (XYZ, rows_of(us, [*table[:, 4:7].T, warm])),
    }


def test_a_ulog_gives_raw_accelerometer_and_gyro_and_asks_which_of_several(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog (trihedron[px4]) is not installed")
    path = tmp_path / "log.ulg"
    path.write_bytes(ulog(raw_topics(0, TABLE)))
    # Single precision in the log.
    assert_same(read_recording(path), atol=1e-6)
    other = TABLE + np.array([0.0, 1, 1, 1, 0, 0, 0])
    path.write_bytes(ulog(raw_topics(0, TABLE) | raw_topics(1, other)))
    with pytest.raises(ReadError, match=r"sensor_accel 0 \(300 messages\), sensor_accel 1 .*--instance 0"):
        read_recording(path)
    assert_same(read_recording(path, instance=1), other, atol=1e-6)
    path.write_bytes(ulog({("vehicle_status", 0): ("float x;", rows_of(range(3), [range(3)]))}))
    with pytest.raises(ReadError, match="without readings"):
        read_recording(path)


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_timetables_of_matlab_mobile_are_both_sensors(tmp_path, version):
    matio = pytest.importorskip("matio", reason="mat-io (trihedron[matlab]) is not installed")
    pandas = pytest.importorskip("pandas")
    start = pandas.Timestamp("2024-03-01 12:00:00.123")
    index = pandas.Index(start + pandas.to_timedelta(TABLE[:, 0], unit="s"), name="Timestamp")
    acc, gyr = (pandas.DataFrame(TABLE[:, k : k + 3], columns=list("XYZ"), index=index) for k in (1, 4))
    path = tmp_path / "sensorlog.mat"
    matio.save_to_mat(str(path), {"Acceleration": acc, "AngularVelocity": gyr}, version=version)
    recording = read_recording(path)
    assert_same(recording)
    one = pandas.concat([acc.add_prefix("a"), gyr.add_prefix("g")], axis=1)
    matio.save_to_mat(str(path), {"walk": one, "again": one}, version=version)
    with pytest.raises(ReadError, match=r"(again|walk) \(300 messages\), (again|walk) \(300 messages\); choose one"):
        read_recording(path)
    assert_same(read_recording(path, topic="walk"))


def batches(instance, table, n=8):
    """FIFO messages of ``n`` samples as PX4 logs them, 1/2048 g and 1/16.4 deg/s; the timestamp is the last's."""
    fields = "uint64_t timestamp_sample;float dt;float scale;uint8_t samples;int16_t[32] x;int16_t[32] y;int16_t[32] z;"
    topics, wanted = {}, []
    for name, columns, scale in (
        ("sensor_accel_fifo", table[:, 1:4], 9.80665 / 2048),
        ("sensor_gyro_fifo", table[:, 4:7], np.pi / 180 / 16.4),
    ):
        counts = np.rint(columns / scale).astype(int)
        bodies = []
        for first in range(0, len(table), n):
            part = counts[first : first + n]
            last = round(5e6 + 1e6 * table[first + len(part) - 1, 0])
            step = 1e6 * (table[1, 0] - table[0, 0])
            padded = np.zeros((3, 32), dtype="<i2")
            padded[:, : len(part)] = part.T
            bodies.append(struct.pack("<QQffB", last + 900, last, step, scale, len(part)) + padded.tobytes())
        topics[(name, instance)] = (fields, bodies)
        wanted.append(counts * np.float32(scale))
    return topics, wanted


def test_batches_of_raw_samples_of_a_ulog_are_unrolled(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog (trihedron[px4]) is not installed")
    path = tmp_path / "log.ulg"
    topics, wanted = batches(0, TABLE)
    path.write_bytes(ulog(topics))
    recording = read_recording(path)
    # 300 samples of each sensor, in 37 messages of eight and one of four.
    assert recording.rows_in_file == recording.rows_read == 2 * len(TABLE)
    # The size of a count is a number of single precision in the message.
    assert recording.accelerometer == pytest.approx(wanted[0], rel=1e-7)
    assert recording.gyroscope == pytest.approx(wanted[1], rel=1e-7)
    assert recording.time_s == pytest.approx(TABLE[:, 0], abs=2e-6)
    path.write_bytes(ulog(topics | batches(1, TABLE)[0]))
    with pytest.raises(ReadError, match=r"sensor_accel_fifo 0 \(300 messages\).*--instance 0"):
        read_recording(path)
    assert read_recording(path, instance=1).n_samples == len(TABLE)


def dataflash(n_imu: int, table=TABLE) -> bytes:
    """A DataFlash log after ArduPilot's AP_Logger: FMT messages describe themselves and IMU with its instance I."""

    def fmt(kind: int, length: int, name: str, form: str, labels: str) -> bytes:
        body = struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), labels.encode())
        return b"\xa3\x95\x80" + body

    labels = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
    form = "QBffffffIIfBBHH"
    packing = "<QBffffffIIfBBHH"
    out = fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    out += fmt(193, 3 + struct.calcsize(packing), "IMU", form, labels)
    for row in table:
        for i in range(n_imu):
            values = (int(6e7 + 1e6 * row[0]), i, *(row[4:7]), *(row[1:4] + i), 0, 0, 40.0, 1, 1, 2000, 2000)
            out += b"\xa3\x95\xc1" + struct.pack(packing, *values)
    return out


def test_a_dataflash_log_asks_which_imu(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink (trihedron[ardupilot], 93 MB) is not installed")
    path = tmp_path / "00000001.BIN"
    path.write_bytes(dataflash(1))
    recording = read_recording(path)
    assert_same(recording, atol=1e-6)
    assert recording.temperature_degc[0] == 40.0
    path.write_bytes(dataflash(2))
    with pytest.raises(ReadError, match=r"IMU 0 \(300 messages\), IMU 1 \(300 messages\)"):
        read_recording(path)
    assert_same(read_recording(path, instance="1"), TABLE + np.array([0, 1, 1, 1, 0, 0, 0]), atol=1e-6)


def test_hdf5_groups_are_told_apart(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py (trihedron[hdf5]) is not installed")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, shift in (("Sensors/XI-1", 0.0), ("Sensors/XI-2", 1.0)):
            group = file.create_group(name)
            group["Accelerometer"] = TABLE[:, 1:4] + shift
            group["Gyroscope"] = TABLE[:, 4:]
            group["Time"] = np.rint(1e6 * TABLE[:, 0]).astype(np.uint64) + 1_709_294_400_000_000
            group["Temperature"] = np.full(len(TABLE), 30.0)
    with pytest.raises(ReadError, match=r"Sensors/XI-1 \(300 messages\), Sensors/XI-2"):
        read_recording(path)
    assert_same(read_recording(path, topic="Sensors/XI-1"))


def write_matlab(folder, table):
    """Columns of a table, by name, as files of both generations, ``old.mat`` and ``new.mat``."""
    import h5py

    columns = {"t": table[:, 0], "acc": table[:, 1:4], "gyro": table[:, 4:], "fs": 100.0}
    savemat(folder / "old.mat", columns)
    # MATLAB 7.3 puts 512 bytes of its own before HDF5 and stores columns as rows.
    with h5py.File(folder / "new.mat", "w", userblock_size=512) as file:
        for name, values in columns.items():
            file[name] = np.atleast_2d(np.asarray(values).T)
    content = (folder / "new.mat").read_bytes()
    (folder / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file" + content[19:])
    return columns


def test_matlab_files_of_both_generations_are_read(tmp_path):
    pytest.importorskip("h5py", reason="h5py (trihedron[hdf5]) is not installed")
    columns = write_matlab(tmp_path, TABLE)
    assert_same(read_recording(tmp_path / "old.mat"))
    savemat(tmp_path / "struct.mat", {"imu": columns, "note": "x"})
    assert_same(read_recording(tmp_path / "struct.mat"))
    assert_same(read_recording(tmp_path / "new.mat"))
    savemat(tmp_path / "empty.mat", {"note": "nothing"})
    with pytest.raises(ReadError, match="no arrays of numbers"):
        read_recording(tmp_path / "empty.mat")


@pytest.mark.parametrize(
    ("magic", "library", "package"),
    [
        (b"#ROSBAG V2.0\n", "rosbags.highlevel", "rosbags"),
        (b"\x89MCAP0\r\n", "rosbags.highlevel", "rosbags"),
        (b"ULog\x01\x12\x35", "pyulog", "pyulog"),
        (b"\xa3\x95\x80\x80", "pymavlink", "pymavlink"),
        (b"\x89HDF\r\n\x1a\n", "h5py", "h5py"),
    ],
)
def test_an_absent_library_is_named_with_its_package(tmp_path, monkeypatch, magic, library, package):
    path = tmp_path / "log.bin"
    path.write_bytes(magic + bytes(200))
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ReadError, match=rf"not installed: pip install {package}\."):
        read_recording(path)


@pytest.mark.parametrize("name", REAL)
def test_real_files_are_read_whole(real_data, name):
    library, options, rows, rate = REAL[name]
    pytest.importorskip(library, reason=f"{library} is not installed")
    recording = trihedron.read(real_data / "formats" / name, **options)
    assert recording.rows_in_file == rows
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
    assert recording.rate_hz == pytest.approx(rate, rel=0.01)
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
