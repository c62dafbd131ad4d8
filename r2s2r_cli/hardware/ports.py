"""The serial ports of this machine, and whether this user may open them. Opens none: a board may reset when it is."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class PortFound:
    """device: its name. description: what it says that it is. allowed: this user may read and write it."""

    device: str
    description: str
    allowed: bool


def serial_ports() -> tuple[PortFound, ...]:
    """By name; ports without any hardware behind them (the ttyS of a PC without plugs) are left out."""
    from serial.tools import list_ports

    found = [port for port in list_ports.comports() if port.hwid not in ("", "n/a") or "USB" in port.device]
    return tuple(
        PortFound(port.device, _description(port.description, port.manufacturer),
                  os.name == "nt" or os.access(port.device, os.R_OK | os.W_OK))
        for port in sorted(found)
    )  # fmt: skip


def _description(description: str | None, manufacturer: str | None) -> str:
    words = [word for word in (description, manufacturer) if word and word != "n/a"]
    return ", ".join(dict.fromkeys(words)) or "no description"
