"""`r2s2r rig`: a virtual robot in a process of its own, to be talked to over a pty, TCP or UDP."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from shlex import quote
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.commands.typed import typed_instead
from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError, UsageError, require_mujoco
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from schemas.results_rig import RigResult

if TYPE_CHECKING:
    from r2s2r_cli.rig.world import World
    from schemas.robot import Robot

_BEHIND_S = 0.1
"""How late the loop may be before it is said."""


class Link(StrEnum):
    """What `--link` takes."""

    PTY = "pty"
    TCP = "tcp"
    UDP = "udp"


class Protocol(StrEnum):
    """What `--protocol` takes."""

    CHECKED = "checked"
    BOARDS = "boards"
    LEGACY = "legacy"


def rig(
    world: Annotated[
        Path | None, typer.Option("--world", metavar="FILE", help="World file; default: an undisturbed world.")
    ] = None,
    robot: Annotated[
        Path | None, typer.Option("--robot", metavar="FILE", help="robot.toml; default: that of the project.")
    ] = None,
    project: ProjectOption = None,
    link: Annotated[Link, typer.Option("--link", help="How hosts reach it.")] = Link.PTY,
    protocol: Annotated[
        Protocol, typer.Option("--protocol", help="Ours, the authors' WiFi boards, or their older serial robot.")
    ] = Protocol.CHECKED,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Where TCP listens, or where UDP sends to.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option("--port", min=0, max=65535, help="The same; default: any free one for TCP, 2390 for UDP."),
    ] = None,
    shared_socket: Annotated[
        bool, typer.Option("--shared-socket", help="UDP: one socket for all boards, not one each.")
    ] = False,
    device: Annotated[
        Path | None, typer.Option("--device", metavar="LINK", help="pty: a link to the device, made and removed here.")
    ] = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Lock-step: time goes on with the ticks that the host asks for.")
    ] = False,
    camera_port: Annotated[
        int | None,
        typer.Option("--camera-port", min=0, max=65535, help="Serve the camera there; 0: any free port."),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FILE", help="Write what really happens to this CSV.")
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option("--points", metavar="FILE", help="Measure its sensors on the bench, for `calibrate`; and stop."),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.0, help="End by itself after this time of the wall clock.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Instead of the seed of the world file.")] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Start a virtual robot and print the device to connect to; Ctrl-C ends it.

    Its physics is MuJoCo's, its boards, wire and camera behave and fail as the world file says (docs/guides/rig.md).

    Example: r2s2r rig --world world.toml --link tcp
    """
    console = Console(json=json, quiet=quiet)
    if device is not None and link is not Link.PTY:
        raise UsageError("only a pty has a device", where="--device", expected="--link pty", received=f"--link {link}",
                         hint=f"r2s2r rig --link {link}")  # fmt: skip
    require_mujoco("r2s2r rig")  # before the world, whose model is the rig's and imports it
    body, surroundings = _robot(robot, project), _world(world, seed)
    if points is not None:
        _measure(console, body, surroundings, points)
        return
    from r2s2r_cli.rig.assembly import Outlet, Rig

    outlet = Outlet(
        link=link.value, protocol=protocol.value, host=host, port=port, shared=shared_socket, device=device, lock=fast,
        camera_port=camera_port, truth=truth,
    )  # fmt: skip
    with _until_told(seconds) as stopping, Rig(body, surroundings, outlet) as one:
        console.document(
            RigResult(
                device=one.address, protocol=protocol.value, robot=body.name, boards=one.boards, lock_step=fast,
                camera=one.camera_address, pid=os.getpid(),
            )
        )  # fmt: skip
        console.data(one.address)
        if one.camera_address is not None:
            console.say(f"camera: {one.camera_address}")
        console.say(f"{body.name} speaks {protocol.value} there{', in lock-step' if fast else ''}; Ctrl-C ends it")
        one.serve(stopping)
        if one.latest_s > _BEHIND_S:
            console.warn(f"the rig was up to {one.latest_s:.2f} s behind: this machine is too busy for real time")


def _measure(console: Console, robot: Robot, world: World, target: Path) -> None:
    from r2s2r_cli.rig.firmware import points_csv
    from r2s2r_cli.store.atomic import write_text

    if not robot.sensors:
        raise InputError("the robot has no sensors to measure", where="robot.toml", expected="[[sensors]]",
                         received="none", hint="r2s2r rig")  # fmt: skip
    if target.exists():
        beside = target.with_name(f"{target.stem}-2.csv")
        # As typed: another world or robot has other sensors.
        raise UsageError("a file is in the way of the table", where=str(target), expected="a new file",
                         received="a file", hint=typed_instead("rig", str(target), str(beside)))  # fmt: skip
    write_text(target, points_csv(robot, world))
    console.document(RigResult(robot=robot.name, points=str(target)))
    console.data(str(target))
    console.hint(f"r2s2r calibrate --points {quote(str(target))}")


def _robot(path: Path | None, project: Path | None) -> Robot:
    from r2s2r_cli.store.project import Project
    from r2s2r_cli.store.toml import load_model
    from schemas.robot import Robot

    return load_model(path, Robot) if path is not None else Project.find(project).robot()


def _world(path: Path | None, seed: int | None) -> World:
    from r2s2r_cli.rig.world import World, load_world

    world = World() if path is None else load_world(path)
    return world if seed is None else world.model_copy(update={"seed": seed})


@contextmanager
def _until_told(seconds: float | None) -> Iterator[Callable[[], bool]]:
    """A function that says whether it is time to end: Ctrl-C, SIGTERM, a closed terminal, or the time asked for.

    A second signal insists: it interrupts whatever the loop may hang in.
    """
    told = Event()

    def tell(*_: object) -> None:
        if told.is_set():
            raise KeyboardInterrupt
        told.set()

    # With nohup a rig outlives its terminal. SIGINT is ignored for every `rig &` of a script, and must end that too.
    closed = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)
    before = {number: signal.signal(number, tell) for number in (signal.SIGINT, signal.SIGTERM, *closed)}
    end = None if seconds is None else time.monotonic() + seconds
    try:
        yield lambda: told.is_set() or (end is not None and time.monotonic() >= end)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
