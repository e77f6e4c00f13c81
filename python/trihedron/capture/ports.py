"""Which serial ports there are."""

from __future__ import annotations

import os
from dataclasses import dataclass

from trihedron.capture.sources import import_serial


@dataclass(frozen=True)
class Port:
    """One port: its name, what the system says of it, and whether this user may open it."""

    device: str
    description: str
    usb: str
    is_permitted: bool


def list_ports() -> list[Port]:
    """Ports in the order of their names; those of USB devices first.

    Raises
    ------
    CaptureError
        When pyserial is not installed.
    """
    import_serial()
    from serial.tools.list_ports import comports

    found = []
    for port in comports():
        usb = f"{port.vid:04x}:{port.pid:04x}" if port.vid is not None else ""
        description = port.description if port.description not in (None, "n/a") else ""
        permitted = not port.device.startswith("/") or os.access(port.device, os.R_OK | os.W_OK)
        found.append(Port(port.device, description, usb, permitted))
    return sorted(found, key=lambda port: (not port.usb, port.device))
