"""Protocols by name, one per file; a decoder turns bytes into frames."""

from __future__ import annotations

from collections.abc import Callable

from trihedron.capture.errors import CaptureError
from trihedron.capture.protocols.contract import Decoder, Frame
from trihedron.capture.protocols.declared import DeclaredDecoder
from trihedron.capture.protocols.lines import (
    LineColumns,
    LinesDecoder,
    NameColumns,
    SixDofTextDecoder,
    name_by_position,
)
from trihedron.capture.protocols.mtdata2 import Mtdata2Decoder
from trihedron.capture.protocols.sbg import SbgDecoder
from trihedron.capture.protocols.sparkfun import RazorDecoder, SixDofDecoder
from trihedron.capture.protocols.vectornav import VectorNavDecoder
from trihedron.capture.protocols.witmotion import WitMotionDecoder
from trihedron.capture.protocols.xio import XioDecoder
from trihedron.records.frame_declaration import FrameDeclaration

__all__ = ["PROTOCOLS", "Decoder", "Frame", "LineColumns", "NameColumns", "decoder_factory", "name_by_position"]

PROTOCOLS: dict[str, str] = {
    "lines": "text: comma, semicolon, tab or blanks; labels ax:1,ay:2; a monitor's time in front",
    "sparkfun-6dof": "SparkFun 6DOF v4, binary frames A ... Z",
    "sparkfun-6dof-text": "SparkFun 6DOF v4, text lines A ... Z",
    "razor": "SparkFun Razor AHRS, text lines #A-R= #M-R= #G-R=",
    "xsens-mtdata2": "Xsens MTData2 (acceleration, rate of turn, counter, sample time)",
    "xio": "xio x-IMU3 inertial messages, text or binary",
    "witmotion": "WitMotion packets 0x55 0x51, 0x52 (clock 0x50 where it is sent)",
    "vectornav": "VectorNav text lines $VNIMU, $VNYMR, $VNQMR, $VNMAR, $VNCMV",
    "sbg": "SBG Systems sbgECom, IMU data and IMU short",
}
"""Name and one sentence; a .toml file declares any other binary frame."""


def decoder_factory(
    protocol: str | FrameDeclaration, name_columns: NameColumns = name_by_position
) -> Callable[[], Decoder]:
    """Makes decoders of one protocol.

    Raises
    ------
    CaptureError
        When there is no protocol of that name.
    """
    if isinstance(protocol, FrameDeclaration):
        declaration = protocol
        return lambda: DeclaredDecoder(declaration)
    makers: dict[str, Callable[[], Decoder]] = {
        "lines": lambda: LinesDecoder(name_columns),
        "sparkfun-6dof": SixDofDecoder,
        "sparkfun-6dof-text": SixDofTextDecoder,
        "razor": RazorDecoder,
        "xsens-mtdata2": Mtdata2Decoder,
        "xio": XioDecoder,
        "witmotion": WitMotionDecoder,
        "vectornav": VectorNavDecoder,
        "sbg": SbgDecoder,
    }
    if protocol not in makers:
        raise CaptureError(f"there is no protocol {protocol!r}; choose {', '.join(makers)}, or a .toml declaration.")
    return makers[protocol]
