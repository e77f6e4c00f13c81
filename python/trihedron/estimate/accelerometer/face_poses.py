"""Which axis of the case points up in a pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.errors import RefusedError
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.words import Words, words
from trihedron.units import AccelerationUnit, acceleration_to_si

LARGEST_TILT_DEG = 20.0
"""A pose further than this from every face is no face: between misplaced by hand (a few degrees) and an edge (45°)."""

FACES: tuple[int, ...] = (1, -1, 2, -2, 3, -3)
"""``+i``: axis i up, ``f = +|g| e_i``. (The manual numbers poses by the face that is *down*: its pose i is -i here.)"""


def face_in_words(face: int) -> Words:
    """``-Y up`` for -2."""
    return words("face", axis=abs(face), is_up=face > 0)


def direction_of(faces: IntArray) -> FloatArray:
    """(n, 3) unit vectors of faces (n,)."""
    unit = np.zeros((len(faces), 3))
    unit[np.arange(len(faces)), np.abs(faces) - 1] = np.sign(faces)
    return unit


def identify(means: FloatArray, raw_unit: AccelerationUnit) -> IntArray:
    """Face (n,) of each mean reading (n, 3): the axis with the largest reading about the common centre; 0 for none.

    The centre is that of the sphere through the readings, so that nothing need be known of zero and scale. In a
    physical unit with too few poses for a sphere it is the nominal zero.

    Raises
    ------
    ValueError
        When the readings hold no sphere and their unit has no nominal zero.
    """
    spread = np.abs(means - means.mean(axis=0)).max()
    unit = (means - means.mean(axis=0)) / (spread if spread > 0 else 1.0)
    design = np.column_stack([2.0 * unit, np.ones(len(unit))])
    if np.linalg.matrix_rank(design, tol=1e-2) == 4:
        solution = np.linalg.lstsq(design, np.sum(unit**2, axis=1), rcond=None)[0]
        centred = unit - solution[:3]
    elif acceleration_to_si(raw_unit) is not None:
        centred = means
    else:
        raise RefusedError(
            f"{len(means)} poses in counts are too few to identify the faces: record all six faces, or say which "
            "face is up in each pose"
        )
    norm = np.linalg.norm(centred, axis=1)
    axis = np.argmax(np.abs(centred), axis=1)
    largest = centred[np.arange(len(centred)), axis]
    faces = np.sign(largest).astype(np.int64) * (axis + 1)
    is_face = np.abs(largest) >= np.cos(np.radians(LARGEST_TILT_DEG)) * norm
    return np.where(is_face & (norm > 0), faces, 0)


def faces_up(means: FloatArray, raw_unit: AccelerationUnit, up: Sequence[int] | None) -> IntArray:
    """Face (n,) of each mean reading (n, 3): as stated, or as they show it.

    Raises
    ------
    ValueError
        When there are no poses, or as :func:`identify` and :func:`given`.
    """
    if len(means) == 0:
        raise RefusedError("no pose was found: keep each of the six faces up and still for some seconds")
    return identify(means, raw_unit) if up is None else given(up, len(means))


def given(up: Sequence[int], n: int) -> IntArray:
    """Faces as the user states them: ±1, ±2, ±3, or 0 for a pose to leave out.

    Raises
    ------
    ValueError
        When they are not n such numbers.
    """
    faces = np.asarray(up)
    if faces.shape != (n,) or not np.all(np.isin(faces, (0, *FACES))):
        raise RefusedError(
            f"faces must be {n} numbers, each ±1, ±2 or ±3 (axis up or down) or 0 (left out), got {list(up)}"
        )
    return faces.astype(np.int64)


def check_sufficient(faces: IntArray) -> None:
    """Twelve parameters need four faces that are not in one plane.

    Raises
    ------
    ValueError
        Naming the missing faces.
    """
    present = {int(face) for face in faces if face}
    missing = [face for face in FACES if face not in present]
    axes = {abs(face) for face in present}
    if len(axes) < 3 or len(present) < 4:
        raise RefusedError(
            "these faces do not determine the accelerometer's twelve parameters; missing: "
            + ", ".join(face_in_words(face) for face in missing)
        )


def left_out(faces: IntArray, values: FloatArray) -> list[Finding]:
    """Poses that are no faces, said."""
    left = np.flatnonzero(faces == 0)
    if len(left) == 0:
        return []
    return [
        Finding.of(
            FindingCode.POSE_NOT_A_FACE,
            n_left_out=len(left),
            n_poses=len(values),
            largest_tilt_deg=LARGEST_TILT_DEG,
            poses=left.tolist(),
        )
    ]
