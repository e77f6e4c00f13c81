"""Protocols of boards, found automatically: one file per manufacturer with the decoder of its frames, which a capture
uses, and the encoders of a simulated board.
"""

from collections.abc import Callable
from typing import Any

from trihedron.errors import InputError
from trihedron.folders import modules_of
from trihedron.protocols.declared import DeclaredDecoder, FrameDeclaration, read_frame_declaration
from trihedron.protocols.framing import Decoder, Encoder
from trihedron.protocols.lines import LinesDecoder, NameColumns, name_by_position

_MODULES = modules_of(__name__, __path__)
_DECODERS: dict[Any, str] = {kind: said for module in _MODULES for kind, said in getattr(module, "SPOKEN", {}).items()}
_ENCODERS: dict[str, Encoder] = {k: one for module in _MODULES for k, one in getattr(module, "ENCODERS", {}).items()}
PROTOCOLS: dict[str, str] = {kind.name: sentence for kind, sentence in _DECODERS.items()}
"""Name and description of each protocol; a .toml file declares any other binary frame."""


def protocol_of(text: str | None) -> str | FrameDeclaration | None:
    """A protocol by name, a frame declared in a .toml file, or None for detection."""
    if text is None or text == "auto":
        return None
    return read_frame_declaration(text) if text.lower().endswith(".toml") else text


def decoder_factory(
    protocol: str | FrameDeclaration, name_columns: NameColumns = name_by_position
) -> Callable[[], Decoder]:
    """A function that makes decoders of one protocol.

    Raises ``InputError`` when no protocol has that name.
    """
    if isinstance(protocol, FrameDeclaration):
        return lambda: DeclaredDecoder(protocol)
    kind = next((kind for kind in _DECODERS if kind.name == protocol), None)
    if kind is None:
        raise InputError(f"there is no protocol {protocol!r}; choose {', '.join(PROTOCOLS)}, or a .toml declaration.")
    return lambda: kind(name_columns) if kind is LinesDecoder else kind()


def encoder_for(protocol: str | FrameDeclaration) -> Encoder:
    """The encoder of frames in that protocol; raises ``InputError`` when no simulated board has that protocol."""
    if isinstance(protocol, FrameDeclaration):
        return protocol.encode
    if protocol not in _ENCODERS:
        raise InputError(f"no simulated board speaks {protocol!r}; choose {', '.join(_ENCODERS)}, or a .toml file.")
    return _ENCODERS[protocol]
