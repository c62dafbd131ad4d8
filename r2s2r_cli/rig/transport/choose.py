"""A transport by its name."""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.errors import UsageError
from r2s2r_cli.rig.transport.base import Transport
from r2s2r_cli.rig.transport.pty import PtyTransport
from r2s2r_cli.rig.transport.tcp import TcpTransport
from r2s2r_cli.rig.transport.udp import PORT, UdpTransport

LINKS = ("pty", "tcp", "udp")
"""Names of the transports."""


def open_transport(
    link: str,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    boards: int = 1,
    shared: bool = False,
    name: Path | None = None,
) -> Transport:
    """Open a link. host, port: where TCP listens (default: a free port), or where UDP sends to (default 2390).

    boards, shared: how many sockets UDP has, or that there is one for all. name: a link to the device of a pty.

    Raises UsageError for an unknown name, HardwareError where the port cannot be had.
    """
    if link == "pty":
        return PtyTransport(name)
    if link == "tcp":
        return TcpTransport(host, port or 0)
    if link == "udp":
        return UdpTransport(host, PORT if port is None else port, boards=boards, shared=shared)
    raise UsageError("no such link", where="--link", expected=", ".join(LINKS), received=link,
                     hint="r2s2r rig --link pty")  # fmt: skip
