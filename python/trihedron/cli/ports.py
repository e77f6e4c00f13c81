"""``trihedron ports``."""

import typer


def ports() -> None:
    """List the serial ports that are plugged in."""
    from trihedron.capture.sources import list_ports

    found = list_ports()
    if not found:
        typer.echo("No serial port is plugged in.")
        return
    width = max(len(port.device) for port in found)
    for port in found:
        words = " ".join(part for part in (port.description, f"[{port.usb}]" if port.usb else "") if part)
        rejected = "" if port.is_permitted else "  (no permission for this user)"
        typer.echo(f"{port.device:{width}}  {words}{rejected}".rstrip())
