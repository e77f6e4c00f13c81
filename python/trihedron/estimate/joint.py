"""Joint fit of both sensors: the reference solution, with the covariance of all 24 parameters."""

from dataclasses import replace

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.bending import with_bending
from trihedron.estimate.accelerometer.verdict import residual_findings
from trihedron.estimate.session.carried import norm_quality
from trihedron.estimate.session.solved import solved
from trihedron.estimate.session.start import Log
from trihedron.records.calibration import Calibration, SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments


def calibrate_joint(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    gravity_source: str,
    nominal_scale: FloatArray | float | None = None,
) -> Calibration:
    """Fit ``S_f, b_f, S_ω`` to the norm of every pose and the rotation of every move at once (equation 5.7).

    The noise of a pose's mean enters its norm and both neighbouring moves, with its full covariance. The frame is
    lower-triangular: the data do not determine the rotation of the triad against the case. The fit starts from
    ``accelerometer``, calibrated alone; ``nominal_scale`` and errors are those of ``calibrate_moves``.
    """
    log = Log(recording, segments, accelerometer, gravity_m_s2, is_given=False)
    found = solved(log, nominal_scale)
    solution, left_out, alone = found.solution, found.held_out, accelerometer.quality
    held = None if left_out is None else (left_out.norm, left_out.norm_sigma)
    quality = norm_quality(solution, held)
    if left_out is None and alone is not None:
        quality = replace(
            quality, held_out=alone.held_out, held_out_sigma=alone.held_out_sigma, held_out_rms=alone.held_out_rms
        )
    calibration = Calibration(
        accelerometer=SensorCalibration(
            S=solution.S_a,
            b=solution.b_a,
            covariance=found.covariance[:12, :12],
            raw_unit=accelerometer.raw_unit,
            si_unit=accelerometer.si_unit,
            method="joint",
            quality=quality,
            observability=accelerometer.observability,
        ),
        gyroscope=found.gyroscope,
        covariance=found.covariance,
        frame="lower",
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        findings=(*residual_findings(quality.chi2, quality, *solution.accel_bias_change), *found.findings),
        averaging=solution.averaging,
    )
    return with_bending(calibration, segments, solution.accel_drift)
