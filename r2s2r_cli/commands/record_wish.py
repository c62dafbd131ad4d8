"""What a command line of `record` or `execute` asks for, and the robot that answers at its port."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.record_journal import Recording
from r2s2r_cli.commands.record_live import way_to_stop
from r2s2r_cli.console import Console
from r2s2r_cli.reached import RIG_REMARK, camera, virtual

if TYPE_CHECKING:
    from r2s2r_cli.devices.link import LinkFacts
    from r2s2r_cli.hardware.guard import GuardedLink
    from r2s2r_cli.stages.record import RunPlan
    from r2s2r_cli.store.project import Iteration, Project
    from schemas.config import RecordSettings
    from schemas.header import InputRef
    from schemas.robot import Robot


@dataclass(frozen=True)
class Wish:
    """One command line of `record` or `execute` (stage), read and checked. inputs: what the policies came from."""

    project: Project
    iteration: Iteration
    robot: Robot
    runs: Sequence[RunPlan]
    settings: RecordSettings
    port: str
    protocol: str
    camera: str | None
    simulated: bool
    overrides: Mapping[str, Any]
    flags: Mapping[str, Any]
    seed: int | None
    draw: bool
    force: bool
    stage: str = "record"
    inputs: Sequence[InputRef] = ()

    def recording(self) -> Recording:
        """Where it goes."""
        return Recording(self.project, self.iteration, self.overrides, self.flags, self.seed, self.stage, self.inputs)


def tell_of_no_camera(wish: Wish, console: Console) -> None:
    """To be said before anything moves: afterwards it is too late for a camera."""
    if wish.camera is None:
        rig = virtual(wish.port)
        console.warn(
            "no camera is named: no states can be estimated from these runs, so `identify` cannot learn from them and "
            f"`compare` has nothing to compare; with one, add {camera(rig=rig)}{f' ({RIG_REMARK})' if rig else ''}"
        )


def guarded(wish: Wish, *, dry_run: bool) -> GuardedLink:
    """The robot at its port, behind the guard; dry_run: no motor moves. Raises HardwareError, UsageError."""
    from r2s2r_cli.hardware.guard import GuardedLink
    from r2s2r_cli.hardware.open_link import open_link

    return GuardedLink(open_link(wish.port, wish.robot, protocol=wish.protocol), wish.robot, dry_run=dry_run)


def remarks(facts: LinkFacts, console: Console) -> None:
    """Say who has answered at the port, and what is to be known of it."""
    for text in facts.remarks:
        console.warn(text)
    console.say(f"{facts.robot or 'robot'} at {facts.port}, protocol {facts.protocol}; {way_to_stop()}")
