"""What cannot be read is one sentence with file, line and remedy, whatever bytes arrive; what was written is read."""

import gzip
import os
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from test_read import HEADER, readings, write
from trihedron.read import ReadError, read_recording
from trihedron.read.errors import stderr_without
from trihedron.read.memory import check_memory
from trihedron.records import Recording

ROWS = [",".join(map(repr, map(float, row))) for row in readings(300)]
TEXT = HEADER + "\n".join(ROWS) + "\n"
FEW = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
FUZZ = settings(FEW, max_examples=120)
WORDS = "1 0 -2.5 1e5 nan inf -inf abc 1,5 0x1F 1e999 1e300 - # % é t ax gx acc_x time None 9999999999999999999999"
TOKENS = st.sampled_from([*WORDS.split(), "", " ", '"', "\x00", "gyr_x [deg/s]", "2024-01-01 00:00:00"])


def with_row(index: int, row: str) -> str:
    return HEADER + "\n".join([*ROWS[:index], row, *ROWS[index + 1 :]]) + "\n"


CASES = {
    "empty": (b"", "the file is empty"),
    "only-line-ends": (b"\n\n\n", "no line of numbers"),
    "header-only": (HEADER.encode(), "no line of numbers"),
    "one-row": ((HEADER + ROWS[0] + "\n").encode(), "one row of numbers only"),
    "text-in-numbers": (with_row(40, "0.4,1,2,abc,5,6,7").encode(), "line 42, column 'az': 'abc' is not a number"),
    "too-few-fields": (with_row(40, "1,2,3").encode(), "line 42 has 3 fields where the others have 7"),
    "too-many-fields": (with_row(40, ROWS[40] + ",9").encode(), "line 42 has 8 fields"),
    "header-again": (with_row(100, HEADER.strip()).encode(), "line 102, column 't': 't' is not a number"),
    "reversed": ((HEADER + "\n".join(ROWS[::-1]) + "\n").encode(), "time runs backward .*first at line 3"),
    "clock-set-back": ((HEADER + "\n".join(ROWS[150:] + ROWS[:150])).encode(), "jumps back by 2.99 .*line 152"),
    "constant-channel": (
        (HEADER + "\n".join(",".join([r.split(",")[0], "0.0", *r.split(",")[2:]]) for r in ROWS)).encode(),
        "column 'ax' of the accelerometer is 0 in all 300 rows",
    ),
    "constant-time": (
        (HEADER + "\n".join(",".join(["1.0", *r.split(",")[1:]]) for r in ROWS)).encode(),
        "time column 't' contains 1 in every row",
    ),
    "binary": (bytes(range(256)) * 20, "zero byte|no line of numbers"),
    "zero-bytes-at-the-end": (TEXT.encode() + b"\0" * 512, "line 302 contains binary data"),
    "web-page": (b"<html><body>404 not found</body></html>\n" * 3, "no line of numbers"),
    "truncated-gzip": (gzip.compress(TEXT.encode())[:-900], "gzip data is damaged or ends too early, after about"),
    "damaged-gzip": (b"\x1f\x8b\x08" + b"junk" * 40, "gzip data is damaged"),
    "not-an-npz": (b"PK\x03\x04" + bytes(range(256)), "damaged"),
    "not-an-npy": (b"\x93NUMPY" + bytes(range(256)), "damaged"),
    "not-parquet": (b"PAR1" + bytes(range(256)), "damaged or cut off"),
    "hdf5": (b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5|h5py cannot read this file"),
    "ros-bag": (b"#ROSBAG V2.0\n" + bytes(100), "ROS bag|rosbags cannot read this bag"),
    "mcap": (b"\x89MCAP0\r\n" + bytes(range(256)) * 3, r"\w"),
    "sqlite": (b"SQLite format 3\x00" + bytes(range(256)) * 3, r"\w"),
    "ulog": (b"ULog\x01\x12\x35\x01" + bytes(range(256)) * 3, r"\w"),
    "nine-unnamed-columns": ((",".join("123456789") + "\n").encode() * 9, "9 columns without names"),
    "all-nan": ((HEADER + "\n".join(f"{i},nan,1,{i},3,{i},5" for i in range(9))).encode(), "contains no finite number"),
    "workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "Excel workbook.*save the sheet as CSV"),
    "blackbox": (b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n" * 5, "blackbox_decode"),
    "json": (b'{"accel": [[1, 2, 3]]}', "this JSON.*from Python"),
    "json-list": (b'[{"t": 0}]', "this JSON"),
    "json-matrix": (b'{"acc": {"S": [[1, 2, 3], [0, 1, 2], [0, 0, 1]], "b": [1, 2, 3]}}', "this JSON is no log"),
    "video": (b"\x00\x00\x00\x18ftypmp42" + bytes(500), "a video.*GPMF"),
    "7z": (b"7z\xbc\xaf\x27\x1c" + bytes(500), "7-Zip archive.*unpack"),
    "xml": (b"<?xml version='1.0'?><a/>", "XML"),
    "mtb": (b"\xfa\xff\x36" + bytes(500), "Xsens MT binary.*MT Manager"),
    "novatel": (b"\xaaD\x13" + bytes(400), "NovAtel.*RAWIMUS"),
    "gpmf": (b"DEVC\0\x01" + bytes(400), "GoPro GPMF"),
}


@pytest.mark.parametrize("content, complaint", CASES.values(), ids=CASES.keys())  # noqa: PT006
def test_a_bad_file_is_one_sentence(tmp_path, content, complaint):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=complaint) as caught:
        read_recording(path)
    sentence = str(caught.value)
    assert "log.csv" in sentence
    assert "\n" not in sentence


def test_pickled_objects_are_not_loaded(tmp_path):
    objects = tmp_path / "objects.npz"
    np.savez(objects, data=np.array([{"a": 1}, None], dtype=object))
    with pytest.raises(ReadError, match="Python objects"):
        read_recording(objects)


@pytest.mark.parametrize("opener", ["access", "open"])
def test_no_permission_and_an_error_of_the_disk_are_said(tmp_path, monkeypatch, opener):
    path = write(tmp_path / "log.csv", readings())

    def broken(*_args, **_keywords):
        raise OSError(5, "Input/output error")

    if opener == "access":
        monkeypatch.setattr("os.access", lambda *_: False)
    else:
        monkeypatch.setattr("pathlib.Path.open", broken)
    with pytest.raises(ReadError, match="no permission to read" if opener == "access" else "Input/output error"):
        read_recording(path)


def test_a_log_larger_than_the_memory_is_refused_before_it_is_read(tmp_path):
    with pytest.raises(ReadError, match=r"about 1e\+08 rows of 7 columns need 11.2 GB .* cut the log into parts"):
        check_memory(tmp_path / "huge.csv", 10**8, 7, available=8 * 10**9)
    check_memory(tmp_path / "huge.csv", 10**6, 7, available=8 * 10**9)


def test_two_files_that_do_not_belong_together_are_refused(tmp_path):
    table = readings()
    acc = write(tmp_path / "acc.csv", table[:, :4], "t,x,y,z\n")
    later = table.copy()
    later[:, 0] += 1000.0
    gyr = write(tmp_path / "gyr.csv", later[:, [0, 4, 5, 6]], "t,x,y,z\n")
    with pytest.raises(ReadError, match="clocks do not overlap"):
        read_recording(accelerometer_path=acc, gyroscope_path=gyr)
    blind = write(tmp_path / "blind.csv", table[:, 4:], "x,y,z\n")
    with pytest.raises(ReadError, match="no time column and the other one has"):
        read_recording(accelerometer_path=acc, gyroscope_path=blind)
    with pytest.raises(ReadError, match="or one file per sensor"):
        read_recording(acc, gyroscope_path=gyr)
    named = write(tmp_path / "named.csv", table[:, :4], "t,ax,ay,az\n")
    with pytest.raises(ReadError, match="swap the two files"):
        read_recording(accelerometer_path=acc, gyroscope_path=named)


@pytest.mark.parametrize(("said", "left"), [("a word of caution\n", "a word of caution\n"), ("panicked at x\n", "")])
def test_words_of_a_library_are_printed_but_for_those_of_a_panic(capfd, said, left):
    with stderr_without(b"panicked at"):
        os.write(2, said.encode())
    assert capfd.readouterr().err == left


def read_bytes(tmp_path, content: bytes, **options) -> Recording | None:
    """The recording, or None when it was rejected in one sentence. Anything else is a failure of the test."""
    path = tmp_path / "fuzz.csv"
    path.write_bytes(content)
    try:
        recording = read_recording(path, **options)
    except ReadError as error:
        sentence = str(error)
    else:
        assert recording.n_samples >= 2
        assert np.all(np.diff(recording.time_s) >= 0)
        return recording
    assert re.fullmatch(r".{1,999}", sentence)
    return None


@FUZZ
@given(
    st.lists(st.lists(TOKENS, min_size=4, max_size=4), min_size=1, max_size=12),
    st.sampled_from([",", ";", "\t", " "]),
    st.booleans(),
)
def test_any_table_of_log_words_under_a_header_is_a_recording_or_a_sentence(tmp_path, rows, separator, packed):
    text = "\n".join([separator.join(["t", "ax", "ay", "az"]), *map(separator.join, rows)])
    read_bytes(tmp_path, gzip.compress(text.encode()) if packed else text.encode())


@FEW
@given(st.text(alphabet="tagxyz=,0123456789- nope", max_size=30))
def test_any_mapping_is_a_recording_or_a_sentence(tmp_path, mapping):
    rng = np.random.default_rng(1)
    rows = np.column_stack([np.arange(9) / 100, rng.standard_normal((9, 6))])
    text = "\n".join(",".join(map(str, map(float, row))) for row in rows) + "\n"
    read_bytes(tmp_path, text.encode(), columns=mapping)
