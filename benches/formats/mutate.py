"""Damaged files through the reader: a recording whose rows are all accounted for, or one sentence; nothing else.

    python benches/formats/mutate.py [COUNT] [SEED] [PROCESSES]

Text files of several makers (40 rows) get one to three kinds of damage. What must hold: no exception but the reader's
own, no text of a panic in it, ``rows_in_file == rows_read + rows_reported``, and, counted here without the reader, as
many rows in the file as it has lines below its header; and nothing on standard
error. Containers (npz, npy, Parquet, zip, gzip, bags, ULog, DataFlash,
HDF5, MATLAB) get damaged bytes.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import more_layouts  # noqa: F401 -- its layouts join the others
from layouts import LAYOUTS

from trihedron.read import ReadError, read_recording

ROWS = 40
HANGS_S = 60
SHARE = 500
"""Files of one seed."""
COUNTED = ("euroc", "kalibr", "px4_ulog2csv", "ximu3", "witmotion", "st_mems", "mars_logger", "physics_toolbox")
COUNTED += ("excel_europe", "american_clock", "plotjuggler", "adis_evaluation")
OTHERS = ("gnsslogger", "arduino_monitor", "arduino_plotter", "adafruit", "movella_dot", "shimmer_consensys", "axivity")
OTHERS += ("gcdc_x16", "microstrain_mip", "gyroflow_gcsv")
OTHERS += ("ardupilot_csv", "actigraph", "openlog_artemis", "androsensor", "i2cdevlib", "empatica", "metabase")
Lines = list[bytes]


def shortened(name: str) -> tuple[bytes, dict[str, object]]:
    made = LAYOUTS[name]()
    content = next(iter(made.files.values()))
    lines = content.split(b"\n")
    keep = ROWS + 40 if name in OTHERS else ROWS + 1
    # Moving rows, so that no channel is constant.
    start = min(len(lines) // 8, 300)
    head = lines[:1] if name in COUNTED else lines[:25]
    return b"\n".join([*head, *lines[start : start + keep - len(head)]]) + b"\n", dict(made.options)


def _line(rng: np.random.Generator, lines: Lines) -> int:
    return int(rng.integers(1, max(len(lines) - 1, 2)))


def _separator(lines: Lines) -> bytes:
    return max((b",", b"\t", b";"), key=lines[-2].count) if len(lines) > 1 else b","


def flip(rng, lines):
    i = _line(rng, lines)
    if lines[i]:
        k = int(rng.integers(len(lines[i])))
        lines[i] = lines[i][:k] + bytes([int(rng.integers(256))]) + lines[i][k + 1 :]


def cut_line(rng, lines):
    i = _line(rng, lines)
    lines[i] = lines[i][: int(rng.integers(len(lines[i]) + 1))]


def drop_line(rng, lines):
    del lines[_line(rng, lines)]


def double_line(rng, lines):
    i = _line(rng, lines)
    lines.insert(i, lines[i])


def swap_lines(rng, lines):
    i, j = _line(rng, lines), _line(rng, lines)
    lines[i], lines[j] = lines[j], lines[i]


def other_separator(rng, lines):
    i, s = _line(rng, lines), _separator(lines)
    other = [b";", b"\t", b" ", b","][int(rng.integers(4))]
    for k in range(i, len(lines) if rng.random() < 0.5 else i + 1):
        lines[k] = lines[k].replace(s, other)


def drop_column(rng, lines):
    i, s = _line(rng, lines), _separator(lines)
    at = int(rng.integers(6))
    for k in range(i, len(lines) if rng.random() < 0.5 else i + 1):
        fields = lines[k].split(s)
        lines[k] = s.join(fields[:at] + fields[at + 1 :])


def word_in_cell(rng, lines):
    i, s = _line(rng, lines), _separator(lines)
    fields = lines[i].split(s)
    word = [b"nan", b"", b"abc", b"NULL", b"1e999", b"-", b'"', b'"1"', b"inf", b"0x12", b"1.2.3"][
        int(rng.integers(11))
    ]
    fields[int(rng.integers(len(fields)))] = word
    lines[i] = s.join(fields)


def remark(rng, lines):
    i = _line(rng, lines)
    lines[i] = [b"#", b"%", b"//", b"/", b"'"][int(rng.integers(5))] + lines[i]


def insert_line(rng, lines):
    junk = [b"ERROR: sensor timeout", b"", b"   ", b"1,2,3", b"# restarted", b"t,ax,ay", b'"', b"1;2;3;4;5;6;7"]
    lines.insert(_line(rng, lines), junk[int(rng.integers(len(junk)))])


def blank_cells(rng, lines):
    i = _line(rng, lines)
    lines[i] = _separator(lines) * lines[i].count(_separator(lines))


def glue_lines(rng, lines):
    i = _line(rng, lines)
    if i + 1 < len(lines):
        lines[i : i + 2] = [lines[i] + lines[i + 1]]


def zero_byte(rng, lines):
    i = _line(rng, lines)
    lines[i] += b"\x00"


def twice(_rng, lines):
    lines[-1:] = lines[1:]


def cut_file(rng, lines):
    del lines[_line(rng, lines) :]
    if lines:
        lines[-1] = lines[-1][: int(rng.integers(len(lines[-1]) + 1))]


DAMAGE: tuple[Callable[[np.random.Generator, Lines], None], ...] = (
    *(
        flip,
        flip,
        cut_line,
        drop_line,
        double_line,
        swap_lines,
        other_separator,
        drop_column,
        word_in_cell,
        word_in_cell,
    ),
    *(remark, insert_line, blank_cells, glue_lines, zero_byte, twice, cut_file),
)


def containers(folder: Path) -> dict[str, bytes]:
    """One small file of every binary format."""
    rng = np.random.default_rng(0)
    table = np.column_stack([np.arange(60) / 100, rng.normal([0, 0, 9.8, 0, 0, 0], 0.1, (60, 6))])
    names = ["t", "ax", "ay", "az", "gx", "gy", "gz"]
    out: dict[str, bytes] = {}
    for key, save in (("npy", lambda b: np.save(b, table)), ("npz", lambda b: np.savez_compressed(b, data=table))):
        buffer = io.BytesIO()
        save(buffer)
        out[key] = buffer.getvalue()
    import polars as pl

    buffer = io.BytesIO()
    pl.DataFrame(table, schema=names).write_parquet(buffer)
    out["parquet"] = buffer.getvalue()
    text = ",".join(names) + "\n" + "\n".join(",".join(map(repr, map(float, r))) for r in table) + "\n"
    out["gzip"] = gzip.compress(text.encode(), mtime=0)
    out["zip"] = next(iter(LAYOUTS["sensor_logger_zip"]().files.values()))
    from scipy.io import savemat

    savemat(folder / "a.mat", dict(zip(names, table.T, strict=True)))
    out["mat"] = (folder / "a.mat").read_bytes()
    with contextlib.suppress(ImportError):
        import h5py

        with h5py.File(folder / "a.h5", "w") as file:
            for name, column in zip(names, table.T, strict=True):
                file[name] = column
        out["hdf5"] = (folder / "a.h5").read_bytes()
    data = Path(__file__).parents[3] / "shared" / "data" / "formats"
    for name, size in (
        ("sparkfun_razor.bag", 60_000),
        ("sample_log_small.ulg", 40_000),
        ("ardupilot_log171.bin", 40_000),
    ):
        if (data / name).is_file():
            out[name] = (data / name).read_bytes()[:size]
    return out


def damaged_bytes(rng: np.random.Generator, content: bytes) -> bytes:
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        k = int(rng.integers(len(out)))
        kind = int(rng.integers(4))
        if kind == 0:
            out[k] = int(rng.integers(256))
        elif kind == 1:
            del out[k : k + int(rng.integers(1, 30))]
        elif kind == 2:
            out[k:k] = rng.bytes(int(rng.integers(1, 30)))
        else:
            del out[max(k, 12) :]
    return bytes(out) or b"x"


def n_rows_below_header(content: bytes) -> int:
    """Lines of a text below its first that hold anything but blanks, counted without the reader."""
    text = content.decode("utf-8", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    return sum(1 for line in text.split("\n")[1:] if line.strip(" "))


def _late(*_: object) -> None:
    raise TimeoutError


def main() -> int:
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 2000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    processes = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    shares = [(min(SHARE, count - first), 1000 * seed + first // SHARE) for first in range(0, count, SHARE)]
    done = []
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for k, one in enumerate(pool.map(damaged_and_read, *zip(*shares, strict=True))):
            done.append(one)
            print(f"{sum(n for n, _ in shares[: k + 1])} files, {sum(len(f) for _, f, _ in done)} failures", flush=True)
    tally = sum((tally for tally, _, _ in done), Counter())
    failures = [failure for _, found, _ in done for failure in found]
    print(f"{count} damaged files, seed {seed}, {sum(s for _, _, s in done):.0f} s of CPU: {dict(tally)}")
    print(f"{len(failures)} failures")
    for failure in failures[:25]:
        print("  ", failure)
    return int(bool(failures))


@cache
def whole_texts() -> dict[str, tuple[bytes, dict[str, object]]]:
    """Every layout before its damage, with its options."""
    return {name: shortened(name) for name in (*COUNTED, *OTHERS)}


def damaged_and_read(count: int, seed: int) -> tuple[Counter[str], list[str], float]:
    """What became of so many files, what went wrong, CPU seconds; standard error is read as well."""
    signal.signal(signal.SIGALRM, _late)
    printed = tempfile.TemporaryFile()  # noqa: SIM115 -- for as long as this process lives
    os.dup2(printed.fileno(), 2)
    rng = np.random.default_rng(seed)
    texts = whole_texts()
    tally: Counter[str] = Counter()
    failures: list[str] = []
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        binary = containers(Path(folder))
        path = Path(folder) / "log.csv"
        for k in range(count):
            options: dict[str, object] = {}
            name, is_counted = "", False
            if rng.random() < 0.15:
                name = list(binary)[int(rng.integers(len(binary)))]
                content = damaged_bytes(rng, binary[name])
            else:
                name = list(texts)[int(rng.integers(len(texts)))]
                content, options = texts[name]
                lines = content.split(b"\n")
                header = lines[0]
                for _ in range(int(rng.integers(1, 4))):
                    if len(lines) > 3:
                        DAMAGE[int(rng.integers(len(DAMAGE)))](rng, lines)
                content = b"\n".join(lines)
                is_counted = name in COUNTED and lines[0] == header
            path.write_bytes(content or b"x")
            signal.alarm(HANGS_S)
            try:
                r = read_recording(path, **options)
            except ReadError as error:
                tally["refused"] += 1
                sentence = str(error)
                if "\n" in sentence or "panic" in sentence.lower() or len(sentence) > 1500:
                    failures.append(f"{k} {name}: sentence {sentence[:200]!r}")
                continue
            except TimeoutError:
                failures.append(f"{k} {name}: still reading after {HANGS_S} s")
                continue
            # Anything else that is raised is what this trial looks for.
            except BaseException as error:
                failures.append(f"{k} {name}: {type(error).__name__}: {str(error)[:200]}")
                if isinstance(error, KeyboardInterrupt):
                    raise
                continue
            finally:
                signal.alarm(0)
            tally["read"] += 1
            tally["read, with rows reported"] += r.rows_reported > 0
            if r.rows_in_file != r.rows_read + r.rows_reported:
                failures.append(f"{k} {name}: {r.rows_in_file} != {r.rows_read} + {r.rows_reported}")
            if is_counted:
                tally["rows counted from outside"] += 1
                expected = n_rows_below_header(content)
                if expected != r.rows_in_file:
                    failures.append(
                        f"{k} {name}: {expected} lines below the header, {r.rows_in_file} rows in the account"
                    )
                    if os.environ.get("KEEP"):
                        Path(f"{os.environ['KEEP']}{k}").write_bytes(content)
    printed.seek(0)
    said = printed.read().decode(errors="replace").strip()
    if said:
        failures.append(f"printed on standard error: {said[:300]!r}")
    return tally, failures, time.process_time() - began


if __name__ == "__main__":
    raise SystemExit(main())
