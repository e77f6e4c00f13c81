"""Which axis of the case points up in a pose."""

from collections.abc import Iterator, Sequence

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.accelerometer import verdict
from trihedron.records import Finding, Segments
from trihedron.records.words import Words, words
from trihedron.session.rounding import undithered_axes
from trihedron.units import AccelerationUnit, acceleration_to_si


def shared_rounding(segments: Segments, step: FloatArray) -> FloatArray | None:
    """Variance (3,) [raw²] of the rounding error that pose means at one place inside an LSB share.

    It is that of the most accurate mean on axes whose noise does not dither the LSB ``step`` (3,), 0 on the others.
    """
    sigma, sigma_mean = segments.accelerometer_sigma, segments.accelerometer_sigma_mean
    if sigma is None or sigma_mean is None:
        return None
    return np.where(undithered_axes(step, sigma), np.min(sigma_mean, axis=0) ** 2, 0.0)


def headings(values: FloatArray, noise: FloatArray) -> IntArray:
    """Heading number (n,) of each pose (n, 2): that of the first earlier pose with the same reading within noise."""
    limit = float(probability.chdtri(2, verdict.SIGNIFICANCE))
    out = np.zeros(len(values), dtype=np.intp)
    first: list[int] = []
    for k in range(len(values)):
        for number, other in enumerate(first):
            apart = values[k] - values[other]
            if float(apart @ np.linalg.pinv(noise[k] + noise[other]) @ apart) < limit:
                out[k] = number
                break
        else:
            out[k] = len(first)
            first.append(k)
    return out


LARGEST_TILT_DEG = 20.0
"""A pose further than this from every face is not a face: above placement errors (a few degrees), below edges (45°)."""

FACES: tuple[int, ...] = (1, -1, 2, -2, 3, -3)
"""``+i``: axis i (1 X, 2 Y, 3 Z) up, ``f = +|g| e_i``. (The manual's pose i has that face *down*: it is -i here.)"""


def face_in_words(face: int) -> Words:
    """``-Y up`` for -2."""
    return words("face", axis=abs(face), is_up=face > 0)


def direction_of(faces: IntArray) -> FloatArray:
    """Unit vectors (n, 3), upward in the body frame, of faces (n,)."""
    unit = np.zeros((len(faces), 3))
    unit[np.arange(len(faces)), np.abs(faces) - 1] = np.sign(faces)
    return unit


def identify(means: FloatArray, raw_unit: AccelerationUnit) -> IntArray:
    """Face (n,) of each mean reading (n, 3): the axis with the largest reading about the common centre; 0 for none.

    The centre is that of the sphere through the readings, so that bias and scale need not be known. With too few poses
    for a sphere, readings in a physical unit are taken about 0. Raises ``InputError`` when the readings determine no
    sphere and are in counts.
    """
    centred = _about_centre(means)
    if centred is not None:
        return _nearest(centred)
    if acceleration_to_si(raw_unit) is not None:
        return _nearest(means)
    raise InputError(
        f"{len(means)} poses in counts are too few to identify the faces: record all six faces, or state which "
        "face is up in each pose"
    )


def are_six_faces(means: FloatArray) -> bool:
    """Whether the mean readings (n, 3) are those of the six faces, each at least once, and of no other pose."""
    centred = _about_centre(means)
    return centred is not None and set(_nearest(centred).tolist()) == set(FACES)


def _about_centre(means: FloatArray) -> FloatArray | None:
    """Readings (n, 3) about the centre of the sphere through them; ``None`` where they determine no sphere."""
    spread = np.abs(means - means.mean(axis=0)).max()
    unit = (means - means.mean(axis=0)) / (spread if spread > 0 else 1.0)
    design = np.column_stack([2.0 * unit, np.ones(len(unit))])
    if np.linalg.matrix_rank(design, tol=1e-2) < 4:
        return None
    return np.asarray(unit - np.linalg.lstsq(design, np.sum(unit**2, axis=1), rcond=None)[0][:3])


def _nearest(centred: FloatArray) -> IntArray:
    """Face (n,) of directions (n, 3): that of the largest component; 0 beyond ``LARGEST_TILT_DEG`` from it."""
    norm = np.linalg.norm(centred, axis=1)
    axis = np.argmax(np.abs(centred), axis=1)
    largest = centred[np.arange(len(centred)), axis]
    faces = np.sign(largest).astype(np.int64) * (axis + 1)
    is_face = np.abs(largest) >= np.cos(np.radians(LARGEST_TILT_DEG)) * norm
    return np.where(is_face & (norm > 0), faces, 0)


def faces_up(means: FloatArray, raw_unit: AccelerationUnit, up: Sequence[int] | None) -> IntArray:
    """Face (n,) of each mean reading (n, 3): ``up`` where given, else identified from the readings.

    Raises ``InputError`` when there are no poses, or as :func:`identify` and :func:`given`.
    """
    if len(means) == 0:
        raise InputError("no pose was found: keep each of the six faces up and still for some seconds")
    return identify(means, raw_unit) if up is None else given(up, len(means))


def given(up: Sequence[int], n: int) -> IntArray:
    """Faces as the user states them: ±1, ±2, ±3, or 0 for a pose to exclude.

    Raises ``InputError`` when ``up`` is not n such numbers.
    """
    faces = np.asarray(up)
    if faces.shape != (n,) or not np.all(np.isin(faces, (0, *FACES))):
        raise InputError(
            f"faces must be {n} numbers, each ±1, ±2 or ±3 (axis up or down) or 0 (left out), got {list(up)}"
        )
    return faces.astype(np.int64)


def check_sufficient(faces: IntArray, fewest: int) -> None:
    """Check for the ``fewest`` faces, of all three axes; the twelve parameters need four.

    Raises ``InputError`` naming the missing faces.
    """
    present = {int(face) for face in faces if face}
    missing = [face for face in FACES if face not in present]
    axes = {abs(face) for face in present}
    if len(axes) < 3 or len(present) < fewest:
        raise InputError(
            "these faces do not determine the accelerometer's twelve parameters; missing: "
            + ", ".join(face_in_words(face) for face in missing)
        )


def left_out(faces: IntArray, values: FloatArray) -> Iterator[Finding]:
    """Finding that names the poses which are not faces."""
    left = np.flatnonzero(faces == 0)
    if len(left) == 0:
        return
    yield Finding.of(
        "pose-not-a-face",
        n_left_out=len(left),
        n_poses=len(values),
        largest_tilt_deg=LARGEST_TILT_DEG,
        poses=(left + 1).tolist(),
    )
