"""A simulated board: a recording sent over a pseudo-terminal or a socket in a board's own protocol, with its faults."""

from trihedron.simulate.device.encoders import ENCODERS, Encoder, Scales, encoder_for
from trihedron.simulate.device.faults import Faults, Sent, parse_faults, spoil
from trihedron.simulate.device.serving import Device, Line, PseudoTerminal, TcpServer, scales_of, serve

__all__ = [
    "ENCODERS",
    "Device",
    "Encoder",
    "Faults",
    "Line",
    "PseudoTerminal",
    "Scales",
    "Sent",
    "TcpServer",
    "encoder_for",
    "parse_faults",
    "scales_of",
    "serve",
    "spoil",
]
