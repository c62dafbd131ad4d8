"""How a port is named on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal
from urllib.parse import urlsplit

from r2s2r_cli.errors import UsageError

UDP_PORT = 2390
"""To which the authors' boards send."""
EXAMPLES = "/dev/ttyUSB0, socket://HOST:PORT, udp://HOST:PORT"


@dataclass(frozen=True)
class PortName:
    """text: as given. kind: which transport. host, port: of tcp and udp."""

    text: str
    kind: Literal["serial", "tcp", "udp"]
    host: str = ""
    port: int = 0


def port_name(text: str) -> PortName:
    """Read a name: a device file or COM3, socket://HOST:PORT, udp://HOST:PORT, or another URL of pyserial.

    The address of udp is ours: the robot's boards send to it. Raises UsageError.
    """
    if not text.strip() or any(ord(c) < 32 for c in text):
        raise _no_port(text, "no name")
    if "://" not in text:
        return PortName(text, "serial")
    try:
        url = urlsplit(text)
        host, port = url.hostname or "", url.port
    except ValueError as error:
        raise _no_port(text, str(error)) from None
    if url.scheme == "udp":
        if url.path.strip("/") or url.query:
            raise _no_port(text, "something behind the port")
        return PortName(text, "udp", host or "0.0.0.0", UDP_PORT if port is None else port)
    if url.scheme == "socket":
        if not host or not port:
            raise _no_port(text, "no host, or no port")
        return PortName(text, "tcp", host, port)
    if url.scheme in ("rfc2217", "loop", "hwgrep", "alt", "spy", "cp2110"):
        return PortName(text, "serial")
    raise _no_port(text, f"{url.scheme}://")


def _no_port(text: str, received: str) -> UsageError:
    return UsageError(f"{text[:80]!r} is no name of a port", where="--port", expected=EXAMPLES, received=received,
                      hint="r2s2r doctor ports")  # fmt: skip
