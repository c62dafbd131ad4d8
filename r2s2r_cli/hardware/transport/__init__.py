"""Ports: a device file, a TCP address or a UDP address, as a source of lines and a sink of bytes. No protocol."""

from __future__ import annotations

from r2s2r_cli.hardware.transport.base import Address, Message, Transport
from r2s2r_cli.hardware.transport.name import PortName, port_name
from r2s2r_cli.hardware.transport.serial_port import SerialPort
from r2s2r_cli.hardware.transport.tcp import TcpStream
from r2s2r_cli.hardware.transport.udp import UdpSocket

__all__ = ["Address", "Message", "PortName", "Transport", "port_name", "transport"]


def transport(port: str) -> Transport:
    """The port of a name, not yet open. Raises UsageError for a name that is none."""
    name = port_name(port)
    if name.kind == "tcp":
        return TcpStream(name)
    if name.kind == "udp":
        return UdpSocket(name)
    return SerialPort(name)
