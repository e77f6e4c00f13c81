"""What the generators of sessions share: the course of a hand's move and products of rotations.

Nothing here is taken from ``trihedron.simulate``.
"""

import numpy as np
from scipy.spatial.transform import Rotation


def minimum_jerk(x):
    """Progress on x in 0 to 1: a quintic whose rate and acceleration vanish at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def running_product(vectors):
    """Rotations e_1, e_1 e_2, ... of rotation vectors (n, 3), by doubling (SciPy's product is ten times slower)."""
    products, reach = np.ascontiguousarray(Rotation.from_rotvec(vectors).as_quat().T), 1
    while reach < len(vectors) and np.any(vectors):
        products = np.hstack([products[:, :reach], _product(products[:, :-reach], products[:, reach:])])
        reach *= 2
    return Rotation.from_quat(products.T)


def _product(p, q):
    """Quaternions p q (4, n), scalar last."""
    (a, b, c, d), (x, y, z, w) = p, q
    return np.stack([
        a * w + d * x + b * z - c * y,
        b * w + d * y + c * x - a * z,
        c * w + d * z + a * y - b * x,
        d * w - a * x - b * y - c * z,
    ])  # fmt: skip
