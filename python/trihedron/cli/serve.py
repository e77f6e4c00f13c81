"""A simulated board for ``trihedron simulate --serve``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from trihedron.records import Recording, Truth


def serve_recording(
    recording: Recording,
    truth: Truth,
    where: str,
    protocol: str,
    faults: str,
    *,
    speed: float,
    baud: int,
    link: Path | None,
) -> None:
    """Send a recording over a pseudo-terminal or a socket until it ends; says where on stdout first."""
    from trihedron.api.capturing import protocol_of
    from trihedron.simulate.device.faults import Sent, parse_faults
    from trihedron.simulate.device.serving import Device, PseudoTerminal, TcpServer, scales_of, serve

    kind, _, port = where.partition(":")
    if kind.upper() not in ("PTY", "TCP") or (port and not port.isdigit()):
        raise typer.BadParameter("--serve takes PTY, TCP, or TCP:PORT")
    spoken = protocol_of(protocol)
    device = Device(
        recording,
        "lines" if spoken is None else spoken,
        parse_faults(faults),
        speed,
        baud=baud,
        scales=scales_of(recording, truth),
    )
    # The protocol must be known before somebody opens the port.
    next(device.pieces(Sent()))
    line = PseudoTerminal(link, baud) if kind.upper() == "PTY" else TcpServer(int(port or 0))
    typer.echo(line.name)
    sent = serve(device, line, lambda text: typer.echo(text, err=True))
    typer.echo(sent.sentence(), err=True)
