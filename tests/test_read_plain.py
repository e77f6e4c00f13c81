"""Plain tables of numbers: the quick way through a log gives what the patient way gives, or leaves it to that."""

import numpy as np
import pytest

from trihedron import _core
from trihedron.read import read_recording
from trihedron.read.text.reader import TextReader


def written(rng: np.random.Generator) -> str:
    """A number as some logger would write it."""
    value = rng.standard_normal() * 10.0 ** rng.integers(-12, 12)
    form = rng.choice(["%.6f", "%.3f", "%g", "%.17g", "%e", "%15.7E", "%+.4f", "%.0f", "%.25f"])
    return str(form % value)


def columns_of(text: str, separator: str, n: int) -> np.ndarray | None:
    """Columns (n, rows) of a plain table, or None where the text is none."""
    table = np.zeros((text.count("\n") + 1, n))
    body = np.frombuffer(text.encode(), dtype=np.uint8)
    rows, is_read = _core.plain_table_into(body, ord(separator), [(0, k) for k in range(n)], [table])
    return table[:rows].T if is_read else None


@pytest.mark.parametrize(("separator", "ends"), [(",", "\n"), (";", "\r\n"), ("\t", "\n"), (" ", "\n")])
def test_every_number_is_the_double_nearest_to_its_digits(separator, ends):
    rng = np.random.default_rng(4)
    cells = [[written(rng) for _ in range(5)] for _ in range(1000)]
    text = ends.join(separator.join(row) for row in cells)
    expected = np.array([[float(cell) for cell in row] for row in cells]).T
    for body in (text, text + ends):
        found = columns_of(body, separator, 5)
        assert found is not None
        np.testing.assert_array_equal(found, expected)


DAMAGED = ("1,2\n3\n", "1,2,3\n4,5\n", "1,2\n\n3,4\n", "1,2\n# remark\n3,4\n", "1,\n2,3\n", "1,2\r3,4\r")
NO_NUMBERS = ("1,nan\n", '"1",2\n', "1,2x\n", "1,2e\n", "1,--2\n", "1,.\n", "1,2,\n", "1;2\n", "1,0x10\n", "1,2 3\n")


@pytest.mark.parametrize("text", [*DAMAGED, *NO_NUMBERS])
def test_anything_else_is_no_plain_table(text):
    assert columns_of(text, ",", 2) is None


def test_a_log_is_read_alike_on_both_ways(tmp_path, monkeypatch):
    rng = np.random.default_rng(2)
    n = 3000
    rows = [
        f"{k / 100:.2f}," + ",".join(f"{v:.7g}" for v in np.add(rng.standard_normal(6), [0, 0, 9.8, 0, 0, 0]))
        for k in range(n)
    ]
    path = tmp_path / "log.csv"
    path.write_text("t,ax,ay,az,gx,gy,gz\n" + "\n".join(rows))
    quick = read_recording(path)
    monkeypatch.setattr(TextReader, "_plain", lambda *_: False)
    patient = read_recording(path)
    np.testing.assert_array_equal(quick.time_s, patient.time_s)
    np.testing.assert_array_equal(quick.accelerometer, patient.accelerometer)
    np.testing.assert_array_equal(quick.gyroscope, patient.gyroscope)
    assert [f.code for f in quick.findings] == [f.code for f in patient.findings]
    assert quick.rows_in_file == patient.rows_in_file
