"""A log of text read into numbers: time and six axes, six decimals."""

import tempfile
from pathlib import Path

import numpy as np

COLUMNS = ("t", "ax", "ay", "az", "gx", "gy", "gz")


def data(n):
    """The path of a log of n rows, written once."""
    import polars

    path = Path(tempfile.gettempdir()) / f"trihedron-rivals-{n}.csv"
    if not path.exists():
        rng = np.random.default_rng(0)
        part = path.with_suffix(".part")
        with part.open("wb") as stream:
            for first in range(0, n, 1_000_000):
                rows = min(1_000_000, n - first)
                values = rng.standard_normal((rows, 7)).round(6)
                values[:, 0] = np.round((first + np.arange(rows)) * 0.005, 3)
                values[:, 3] += 9.8
                frame = polars.DataFrame(dict(zip(COLUMNS, values.T, strict=True)))
                frame.write_csv(stream, include_header=first == 0, float_precision=6)
        part.rename(path)
    with path.open("rb") as stream:
        while stream.read(1 << 24):
            pass
    return (str(path),)


def ours(path):
    """Read and audited: units, clock, gaps, clipping, repeated readings, digest."""
    import trihedron

    return trihedron.read(path)


def pandas(path):
    import pandas

    return pandas.read_csv(path).to_numpy()


def pandas_arrow(path):
    import pandas

    return pandas.read_csv(path, engine="pyarrow").to_numpy()


def polars(path):
    import polars

    return polars.read_csv(path).to_numpy()


def pyarrow(path):
    from pyarrow import csv

    return np.column_stack([column.to_numpy() for column in csv.read_csv(path).columns])


def parser(path):
    """Our parser alone, without the audit."""
    from trihedron import _core

    text = np.fromfile(path, np.uint8)
    text = text[bytes(text[:200]).index(b"\n") + 1 :]
    rows, _ = _core.plain_table_into(text, ord(","), [], [])
    table = np.empty((rows, 7))
    _core.plain_table_into(text, ord(","), [(0, k) for k in range(7)], [table])
    return table


READ = {
    "trihedron, read and audited": ours,
    "trihedron, its parser": parser,
    "pandas": pandas,
    "pandas with pyarrow": pandas_arrow,
    "polars": polars,
    "pyarrow": pyarrow,
}
