"""Records that the stages exchange: frozen dataclasses, validated when made.

One file per subject. A stage takes records and returns records; it never imports another stage.
"""

from collections.abc import Callable

from trihedron.records.allan_curve import AllanCurve
from trihedron.records.calibration import (
    PARAMETER_NAMES,
    Calibration,
    FitQuality,
    Frame,
    Observability,
    SensorCalibration,
)
from trihedron.records.finding import Finding, Severity
from trihedron.records.kalman import (
    CONSTANT_NAMES,
    AxisKalmanResult,
    AxisNoise,
    Consistency,
    ConstantsTrack,
    KalmanCalibration,
    NormKalmanCalibration,
    PoseTable,
)
from trihedron.records.noise import GaussMarkov, Noise, NoiseAxis, NoiseTerm, SlowPair, SpectralLine, TermName
from trihedron.records.onboard import Onboard
from trihedron.records.recording import Recording
from trihedron.records.sampling import Sampling, TimestampKind
from trihedron.records.segments import Move, Pose, Segments
from trihedron.records.truth import Comparison, TrueSegment, Truth
from trihedron.records.verification import Verification

Progress = Callable[[float, str], None]
"""Callback of a long step, called with the fraction done (0 to 1) and a few words on the current step."""
