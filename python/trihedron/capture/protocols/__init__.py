"""Protocols by name, one manufacturer per file, found automatically; a decoder converts bytes to frames."""

from collections.abc import Callable
from typing import Any

from trihedron.capture.errors import CaptureError
from trihedron.capture.protocols.framing import DeclaredDecoder, Decoder, Frame
from trihedron.capture.protocols.lines import LineColumns, LinesDecoder, NameColumns, name_by_position
from trihedron.folders import modules_of
from trihedron.records.frame_declaration import FrameDeclaration

__all__ = ["PROTOCOLS", "Decoder", "Frame", "LineColumns", "NameColumns", "decoder_factory", "name_by_position"]

_SPOKEN = [one for module in modules_of(__name__, __path__) for one in getattr(module, "SPOKEN", {}).items()]
_DECODERS: dict[str, Any] = {kind.name: kind for kind, _ in _SPOKEN}
PROTOCOLS: dict[str, str] = {kind.name: sentence for kind, sentence in _SPOKEN}
"""Name and description of each protocol; a .toml file declares any other binary frame."""


def decoder_factory(
    protocol: str | FrameDeclaration, name_columns: NameColumns = name_by_position
) -> Callable[[], Decoder]:
    """A function that makes decoders of one protocol.

    Raises ``CaptureError`` when no protocol has that name.
    """
    if isinstance(protocol, FrameDeclaration):
        return lambda: DeclaredDecoder(protocol)
    if protocol not in PROTOCOLS:
        raise CaptureError(f"there is no protocol {protocol!r}; choose {', '.join(PROTOCOLS)}, or a .toml declaration.")
    kind = _DECODERS[protocol]
    return lambda: kind(name_columns) if kind is LinesDecoder else kind()
