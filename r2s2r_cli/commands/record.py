"""`r2s2r record`: policies on the robot, everything raw -> 10-record.h5."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.commands.robot_link import PortOption, ProtocolOption, link_of
from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import (
    DrawOption,
    DryRunOption,
    IterationOption,
    JsonOption,
    ProjectOption,
    QuietOption,
    SetOption,
    ShowConfigOption,
    parse_overrides,
)
from r2s2r_cli.store.project import Project

if TYPE_CHECKING:
    from schemas.policy import PolicyFile
    from schemas.robot import Robot


class Excitation(StrEnum):
    """What `--excite` takes."""

    RAMPS = "ramps"
    HOLDS = "holds"
    REVERSALS = "reversals"
    REPEATS = "repeats"
    COMMISSION = "commission"


def record(
    policies: Annotated[
        list[str] | None,
        typer.Argument(help="Policies: a TOML file, an artifact, or ARTIFACT.h5:NAME.", show_default=False),
    ] = None,
    port: PortOption = None,
    protocol: ProtocolOption = None,
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera", metavar="CAMERA", help="realsense[:SERIAL], open3d, rig://HOST:PORT or replay:FOLDER."
        ),
    ] = None,
    random: Annotated[
        int | None, typer.Option("--random", metavar="N", help="Also a random policy of N target shapes.")
    ] = None,
    levels: Annotated[
        int, typer.Option("--levels", help="Targets a cable can have in the random policy: 2 is short or long.")
    ] = 2,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random policy; it gives it its name.")] = 0,
    excite: Annotated[
        list[Excitation] | None,
        typer.Option("--excite", help="Also a named set: single cables in ramps, holds, reversals, or repeats."),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", metavar="N", help="Every policy N times, taking turns.")] = 1,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="It is a rig: mark the runs so. A rig in lock-step says it by itself.")
    ] = False,
    project: ProjectOption = None,
    iteration: IterationOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
    force: Annotated[
        bool, typer.Option("--force", help="Although there is a recording: it is kept as 10-record.h5.replaced.")
    ] = False,
    set_: SetOption = None,
    show_config: ShowConfigOption = False,
) -> None:
    """Run policies on the robot and keep all that comes: capacitances, commands, motors, inertial units, pictures.

    Each run begins and ends in the rest shape. While the robot moves the space bar is the emergency stop. Whatever ends
    a recording, what there is of it is sealed. --dry-run moves nothing: it looks at the sensors and says the plan.

    Example: r2s2r record --random 15 --port /dev/ttyUSB0 --protocol legacy --camera realsense
    """
    from r2s2r_cli.commands.cameras import stored_camera
    from r2s2r_cli.commands.outcome import print_config
    from r2s2r_cli.commands.record_look import look
    from r2s2r_cli.commands.record_run import carry_out
    from r2s2r_cli.commands.record_wish import Wish, tell_of_no_camera
    from r2s2r_cli.commands.simulate_inputs import stored_names
    from r2s2r_cli.commands.wanted import wanted
    from r2s2r_cli.stages.record import plans

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    overrides = parse_overrides(set_, "record")
    if show_config:
        print_config("record", wanted(here, place, "record", overrides, {}).settings, console)
        return
    robot, link = here.robot(), link_of(here, port, protocol)
    sets = tuple(one.value for one in excite or ())
    chosen = _policies(robot, policies or [], random, levels, seed, sets)
    settings = here.config(place, overrides).record
    runs = plans(chosen, repeats=repeats, rest=settings.rest_s)
    flags = {
        "policies": stored_names(here, policies or ()), "port": link.port, "protocol": link.protocol,
        "camera": stored_camera(here, camera), "random": random, "levels": levels,
        "excite": list(sets), "repeats": repeats, "simulated": simulated,
    }  # fmt: skip
    wish = Wish(
        project=here, iteration=place, robot=robot, runs=runs, settings=settings, port=link.port or "",
        protocol=link.protocol, camera=camera, simulated=simulated, overrides=overrides, flags=flags,
        seed=None if random is None else seed, draw=draw, force=force,
    )  # fmt: skip
    tell_of_no_camera(wish, console)
    if dry_run:
        look(wish, console)
        return
    if link.port is None:
        raise UsageError("no robot is named", where="--port", expected="a device, socket://HOST:PORT or udp://HOST:PORT",
                         received="nothing",
                         hint="r2s2r doctor ports   # what to name, or set as link.port in project.toml")  # fmt: skip
    carry_out(wish, console)


def _policies(
    robot: Robot, files: list[str], random: int | None, levels: int, seed: int, sets: tuple[str, ...]
) -> list[PolicyFile]:
    """The policies asked for. Raises InputError, UsageError."""
    from r2s2r_cli.commands.simulate_inputs import read_policies
    from r2s2r_cli.reached import ROBOT
    from r2s2r_cli.stages.record import excitation, random_targets
    from r2s2r_cli.stages.simulate.policies import sequence

    found = [policy for text in files for policy in read_policies(text)]
    if random is not None:
        found.append(random_targets(robot, random, seed, levels=levels))
    found += [policy for name in sets for policy in excitation(robot, name)]
    if not found:
        raise UsageError("there is nothing to record", where="r2s2r record",
                         expected="a policy file, --random N or --excite NAME", received="none of them",
                         hint=f"r2s2r record --random 15 {ROBOT}")  # fmt: skip
    for policy in found:
        sequence(policy, robot)  # for this robot, before anything moves
    return found
