"""The same bits whatever the number of threads and cores, the same answers whatever the instructions of a processor."""

import json
import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "POLARS_MAX_THREADS")


FIT = """
import hashlib
import numpy as np
import trihedron
from trihedron import _core
rng = np.random.default_rng(3)
d = rng.standard_normal((60_000, 3))
raw = 9.81 * d / np.linalg.norm(d, axis=1)[:, None] * [1.01, 0.99, 1.02] + 0.1 + rng.normal(0.0, 1e-2, d.shape)
fit = _core.fit_norm(raw, 1e-4 * np.eye(3)[None], _core.NormSettings(9.81))
deviation = _core.allan_variance(raw, [1, 8, 512], _core.AllanKind.Overlapping)[0]
attitude = trihedron.integrate_rate(np.arange(60_000) / 100.0, d)
found = (fit.S, fit.b, fit.covariance, deviation, attitude)
print([hashlib.sha256(np.ascontiguousarray(x).tobytes()).hexdigest() for x in found])
"""


def test_sums_shared_between_threads_have_the_same_bits():
    assert len({_printed(threads) for threads in ("1", "3")}) == 1


def _printed(threads):
    path = os.pathsep.join(p for p in sys.path if p)
    environment = {**os.environ, **dict.fromkeys(LIBRARIES, threads), "PYTHONPATH": path}
    return subprocess.run([sys.executable, "-c", FIT], env=environment, capture_output=True, check=True).stdout


PROGRAM = """
import json, numpy as np, trihedron
from trihedron import _core
rng = np.random.default_rng(8)
t = np.cumsum(rng.uniform(0.005, 0.015, 1500)); w = 2.0 * rng.standard_normal((1500, 3))
up = rng.standard_normal((37, 3)); up *= 9.8 / np.linalg.norm(up, axis=1, keepdims=True)
readings = up @ np.array([[1.02, 0, 0], [0.01, 0.97, 0], [-0.02, 0.03, 1.0]]).T + [0.1, -0.2, 0.3]
readings += 1e-3 * rng.standard_normal((37, 3))
out = [trihedron.integrate_rate(t, w)[-1], *_core.block_statistics(w, 7)[:2]]
edges, anchors = np.array([[3, 700], [701, 1490]]), np.array([[-1.0, 8.0], [6.0, 20.0]])
zero = np.full((2, 3), 0.01)
noise = _core.RateNoise(np.full(3, 1e-4), 1e-4, 0.01)
out += _core.integrate_moves(t, w, edges, anchors, np.eye(3) * 1.01, zero, zero, 3, noise)
for symmetric in (False, True):
    fit = _core.fit_norm(readings, 1e-6 * np.eye(3)[None], _core.NormSettings(9.8, symmetric=symmetric))
    out += [fit.S, fit.b, fit.covariance / fit.covariance.max(), fit.residuals]
print(json.dumps(np.concatenate([np.ravel(part) for part in out]).tolist()))
"""


@cache
def answers(instructions: str) -> np.ndarray:
    environment = os.environ | {"TRIHEDRON_INSTRUCTIONS": instructions}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout))


@pytest.mark.parametrize("instructions", ["avx2", "portable"])
def test_every_set_of_instructions_gives_the_same_answers(instructions):
    # Numbers of order one to ten after thousands of operations; fits stop within 1e-12 of the same minimum.
    np.testing.assert_allclose(answers(instructions), answers("widest"), rtol=0.0, atol=2e-11)
