"""Whatever bytes arrive, the answer is a recording or a sentence; and what was written is what is read."""

import gzip
import io
import re

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from trihedron.read import ReadError, read_recording
from trihedron.read.names import parse_name
from trihedron.records import Recording

FEW = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
FUZZ = settings(FEW, max_examples=120)


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


WORDS = "1 0 -2.5 1e5 nan inf -inf abc 1,5 0x1F 1e999 1e300 - # % é t ax gx acc_x time None 9999999999999999999999"
TOKENS = st.sampled_from([*WORDS.split(), "", " ", '"', "\x00", "gyr_x [deg/s]", "2024-01-01 00:00:00"])
SEPARATORS = st.sampled_from([",", ";", "\t", " ", "  ", ", ", "\n", "\r\n", "\r", ",,"])


@FUZZ
@given(st.lists(st.tuples(TOKENS, SEPARATORS), max_size=60))
@example([("t", ","), ("ax", "\n"), ('"', ","), ("1", "\n")])
def test_any_mixture_of_log_words_is_a_recording_or_a_sentence(tmp_path, words):
    read_bytes(tmp_path, "".join(token + separator for token, separator in words).encode())


@FUZZ
@given(
    st.lists(st.lists(TOKENS, min_size=4, max_size=4), min_size=1, max_size=12),
    st.sampled_from([",", ";", "\t", " "]),
    st.booleans(),
)
def test_any_table_of_log_words_under_a_header_is_a_recording_or_a_sentence(tmp_path, rows, separator, packed):
    text = "\n".join([separator.join(["t", "ax", "ay", "az"]), *map(separator.join, rows)])
    read_bytes(tmp_path, gzip.compress(text.encode()) if packed else text.encode())


FINITE = st.floats(-1e12, 1e12, allow_nan=False, allow_subnormal=False)


@FEW
@given(
    st.lists(st.tuples(*[FINITE] * 6), min_size=3, max_size=30),
    st.sampled_from(["csv", "tsv", "blanks", "semicolon", "comma-decimals", "gzip", "npz", "npy", "parquet"]),
)
def test_what_was_written_is_what_is_read(tmp_path, rows, kind):
    table = np.array(rows)
    if np.any(np.all(table == table[0], axis=0)):
        return  # A constant channel is rejected, and tested to be.
    names = ["ax", "ay", "az", "gx", "gy", "gz"]
    buffer = io.BytesIO()
    if kind == "npz":
        np.savez(buffer, acc=table[:, :3], gyr=table[:, 3:])
    elif kind == "npy":
        fields = np.empty(len(table), dtype=[(name, float) for name in names])
        for name, column in zip(names, table.T, strict=True):
            fields[name] = column
        np.save(buffer, fields)
    elif kind == "parquet":
        pl.DataFrame(table, schema=names).write_parquet(buffer)
    else:
        separator = {"tsv": "\t", "blanks": "   ", "semicolon": ";", "comma-decimals": ";"}.get(kind, ",")
        cell = (lambda v: repr(v).replace(".", ",")) if kind == "comma-decimals" else repr
        lines = [separator.join(names), *(separator.join(cell(float(v)) for v in row) for row in table)]
        content = ("\n".join(lines) + "\n").encode()
        buffer.write(gzip.compress(content) if kind == "gzip" else content)
    recording = read_bytes(tmp_path, buffer.getvalue(), rate_hz=100.0)
    assert recording is not None
    np.testing.assert_array_equal(recording.accelerometer, table[:, :3])
    np.testing.assert_array_equal(recording.gyroscope, table[:, 3:])


ROLES = ("", "accelerometer", "gyroscope", "translation", "bare", "time", "temperature", "supply", "counter")


@FEW
@given(st.text(max_size=40))
def test_any_column_name_has_a_meaning_or_none(name):
    assert parse_name(name).role in ROLES


@FEW
@given(st.text(alphabet="tagxyz=,0123456789- nope", max_size=30))
def test_any_mapping_is_a_recording_or_a_sentence(tmp_path, mapping):
    rng = np.random.default_rng(1)
    rows = np.column_stack([np.arange(9) / 100, rng.standard_normal((9, 6))])
    text = "\n".join(",".join(map(str, map(float, row))) for row in rows) + "\n"
    read_bytes(tmp_path, text.encode(), columns=mapping)


@pytest.mark.parametrize("seed", range(18))
def test_any_clock_is_a_recording_or_a_sentence(tmp_path, seed):
    rng = np.random.default_rng(seed)
    n = 60
    clocks = [
        rng.standard_normal(n),
        np.sort(rng.integers(0, 10, n)).astype(float),
        rng.integers(0, 2**16, n).astype(float),
        np.where(rng.random(n) < 0.3, np.nan, np.arange(n)),
        np.full(n, 1e300) * rng.random(n),
        np.cumsum(rng.exponential(1.0, n)) * 10.0 ** rng.integers(-12, 12),
    ]
    table = np.column_stack([clocks[seed % len(clocks)], rng.standard_normal((n, 6))])
    text = "t,ax,ay,az,gx,gy,gz\n" + "\n".join(",".join(map(str, map(float, row))) for row in table)
    read_bytes(tmp_path, text.encode())
