"""Which robot a command moves: `--port` and `--protocol`, and what project.toml says where they are not given."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import typer

from r2s2r_cli.store.project import Project


class Protocol(StrEnum):
    """What `--protocol` takes."""

    CHECKED = "checked"
    BOARDS = "boards"
    LEGACY = "legacy"


PortOption = Annotated[
    str | None,
    typer.Option(
        "--port",
        metavar="PORT",
        help="The robot: /dev/ttyUSB0, socket://HOST:PORT or udp://HOST:PORT. Default: link.port of project.toml.",
    ),
]
ProtocolOption = Annotated[
    Protocol | None,
    typer.Option(
        "--protocol",
        help="How it talks; only `checked` stops by itself. Default: link.protocol of project.toml.",
        show_default=False,
    ),
]


@dataclass(frozen=True)
class RobotLink:
    """port: None where nobody names one."""

    port: str | None
    protocol: str


def link_of(project: Project, port: str | None, protocol: Protocol | str | None) -> RobotLink:
    """What the command line says, else the section `link` of project.toml."""
    own = project.file.link
    return RobotLink(port or own.port or None, str(protocol or own.protocol))
