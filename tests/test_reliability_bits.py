"""The same bits whatever the number of threads and cores: what is published can be made again anywhere."""

import os
import re
import shutil

import pytest

from small_session import G, copied, run

WORDS = {
    "calibrate": ["calibrate", "log.csv", "--gravity", G, "--json", "OUT"],
    "diagnose": ["diagnose", "log.csv", "--gravity", G, "--json", "OUT"],
    "allan": ["allan", "rest.csv", "--json", "OUT"],
    "kalman": ["kalman", "log.csv", "--gravity", G, "--json", "OUT"],
    "simulate": ["simulate", "s.toml", "--seed", "7", "-o", "OUT"],
    "check": ["check", "log.csv", "--json", "OUT"],
    "verify": ["verify", "c.json", "log.csv", "--json", "OUT"],
    "segment": ["segment", "log.csv", "--json", "OUT"],
    "apply": ["apply", "c.json", "log.csv", "-o", "OUT"],
}
LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "POLARS_MAX_THREADS")


@pytest.mark.parametrize("name", WORDS)
def test_outputs_do_not_depend_on_threads_or_cores(tmp_path, name):
    folder = copied(tmp_path)
    ending = {"simulate": ".csv", "apply": ".csv"}.get(name, ".json")
    made = {}
    for case, threads in {"one": "1", "three": "3", "one core": "2"}.items():
        out = folder / f"out{ending}"
        words = [str(out) if word == "OUT" else word for word in WORDS[name]]
        one_core = {"preexec_fn": lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})}
        options = one_core if case == "one core" and hasattr(os, "sched_setaffinity") else {}
        status, _, err = run(*words, cwd=folder, env=dict.fromkeys(LIBRARIES, threads), **options)
        assert status in (0, 2), err
        # The one thing that is of its day.
        made[case] = re.sub(r'"(made_at|created)": "[^"]*"', "", out.read_text())
        shutil.move(out, folder / f"{case}{ending}")
    assert made["one"] == made["three"]
    assert made["one"] == made["one core"]
