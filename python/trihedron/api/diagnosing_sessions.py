"""Diagnose several recordings of one unit: each alone, and the effects that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import AnyRecording, recording_of
from trihedron.api.sessions import of_several_units, refuse_again
from trihedron.defaults import FALSE_ALARM
from trihedron.diagnose import diagnose_recordings
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.records import Progress
from trihedron.records.calibration import Calibration
from trihedron.records.diagnosis import SharedDiagnosis
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.segment import resegment


def diagnose_sessions(
    recordings: Sequence[AnyRecording],
    *,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> SharedDiagnosis:
    """Effects that several recordings of one unit share, and effects of single recordings.

    An effect of the instrument has one size in all recordings: their evidence for it adds (docs/diagnosis-method.md).

    Parameters
    ----------
    recordings : sequence of Recording, or what trihedron.read takes
        Two or more of the same unit.
    gravity_m_s2 or latitude_deg, height_m : float
        As for :func:`calibrate`.
    alpha : float
        Probability that healthy recordings are said to share an effect.
    progress : callable
        Called with the share done (0 to 1) and what is being done.

    Returns
    -------
    SharedDiagnosis
        ``effects`` that are shared, with common parameters and those of every recording; ``diagnoses`` of each.

    Raises
    ------
    ValueError
        When there are fewer than two recordings, one is given twice, or one cannot be calibrated.

    Examples
    --------
    >>> import trihedron
    >>> together = trihedron.diagnose_sessions(["monday.csv", "friday.csv"], latitude_deg=50.1)  # doctest: +SKIP
    """
    given: list[tuple[Recording, Segments, Calibration]] = []
    results = []
    for one in recordings:
        recording = recording_of(one, latitude_deg)
        refuse_again(recording, (other for other, _, _ in given))
        try:
            result = calibrate(recording, gravity_m_s2=gravity_m_s2, latitude_deg=latitude_deg, height_m=height_m)
        except INPUT_ERRORS as error:
            raise InputError(f"{recording.source}: {error}") from None
        results.append(result)
        given.append((recording, resegment(recording, result.segments), result.calibration))
    found = diagnose_recordings(given, alpha=alpha, progress=progress)
    calibrations = tuple(calibration for _, _, calibration in given)
    return replace(found, calibrations=calibrations, findings=of_several_units(results))
