"""Where another machine is, by its name."""

from __future__ import annotations

import socket

from r2s2r_cli.errors import HardwareError


def ipv4_of(host: str, link: str) -> str:
    """The IPv4 address of a host, looked up once. link: name of the transport, for the hint.

    Raises HardwareError where there is no such host: datagrams to it would all be lost, and nobody would see why.
    """
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that no host can have
        raise HardwareError(
            "there is no such host", where=f"--host {host}", expected="a name that is known here, or an IPv4 address",
            received=getattr(error, "strerror", None) or str(error), hint=f"r2s2r rig --link {link}",
        ) from error  # fmt: skip
