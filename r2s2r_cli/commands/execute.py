"""`r2s2r execute`: policies of the plan on the robot, their simulated outcome first -> 50-execute.h5."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.commands.robot_link import PortOption, ProtocolOption, RobotLink, link_of
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
    parse_overrides,
)
from r2s2r_cli.store.project import Iteration, Project

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.header import Header, InputRef
    from schemas.policy import PolicyFile


def execute(
    policies: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of policies of 40-plan.h5, policy files or ARTIFACT.h5:NAME. Default: its long ones.",
            show_default=False,
        ),
    ] = None,
    port: PortOption = None,
    protocol: ProtocolOption = None,
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera", metavar="CAMERA", help="realsense[:SERIAL], open3d, rig://HOST:PORT or replay:FOLDER."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="FILE",
            help="Show the outcome with the numbers of this 30-identify.h5. Default: the iteration's own.",
        ),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", metavar="N", help="Every policy N times, taking turns.")] = 1,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the robot moves: for scripts.")] = False,
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
        bool, typer.Option("--force", help="Although there are executed runs: they are kept as 50-execute.h5.replaced.")
    ] = False,
    set_: SetOption = None,
) -> None:
    """Show what the policies of the plan do in the simulator, ask, then run them on the robot and keep all that comes.

    The same recorder, guard and emergency stop (the space bar) as `record`; put the robot to another place between
    repeats. --dry-run ends after the simulated outcome, whatever was executed before.

    Example: r2s2r execute straight --port /dev/ttyUSB0 --protocol legacy --camera realsense
    """  # fmt: skip
    from r2s2r_cli.commands.asking import answered, require_answer
    from r2s2r_cli.commands.cameras import require_named, stored_camera
    from r2s2r_cli.commands.execute_outcome import expect
    from r2s2r_cli.commands.outcome import require_model
    from r2s2r_cli.commands.record_look import look
    from r2s2r_cli.commands.record_run import carry_out
    from r2s2r_cli.commands.record_wish import Wish, tell_of_no_camera
    from r2s2r_cli.stages.record import plans
    from r2s2r_cli.store.staleness import artifact_ref

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, first="r2s2r plan")
    overrides = parse_overrides(set_, "record")
    robot, link = here.robot(), link_of(here, port, protocol)
    chosen, inputs = _chosen(here, place, policies or [], console)
    settings = here.config(place, overrides).record
    again = ["execute", *(policies or ["straight"])[:1], "--iteration", str(place.number), *["--dry-run"] * dry_run]
    runs = plans(chosen, repeats=repeats, rest=settings.rest_s, again=shlex.join(again))
    require_named(camera)  # it is opened after the simulation, which takes its time
    own = place.artifact("identification")
    numbers = model if model is not None else own if own.exists() else None
    if numbers is not None:
        inputs = [*inputs, artifact_ref(here, numbers, require_model(here, numbers, "execute"))]
    wish = Wish(
        project=here, iteration=place, robot=robot, runs=runs, settings=settings, port=link.port or "",
        protocol=link.protocol, camera=camera, simulated=simulated, overrides=overrides,
        flags={
            "policies": _stored(here, policies or ()), "port": link.port, "protocol": link.protocol,
            "camera": stored_camera(here, camera), "repeats": repeats, "simulated": simulated,
            "model": None if numbers is None else here.relative(numbers),
        },
        seed=None, draw=draw, force=force, stage="execute", inputs=inputs,
    )  # fmt: skip
    tell_of_no_camera(wish, console)
    if not dry_run:  # before the simulation, which takes its time
        _require_named(link)
        # Both at once: who adds --force by the hint would be told of --yes next.
        wish.recording().require_room(force=force, more=() if answered(yes=yes) else ("--yes",))
        require_answer("execute", yes=yes)
    expect(here, place, runs, numbers, console, camera=camera is not None)
    if dry_run:
        look(wish, console)
        return
    if not yes:
        _ask(console)
    carry_out(wish, console)


def _require_named(link: RobotLink) -> None:
    """Raises UsageError where no robot is named."""
    if link.port is None:
        raise UsageError("no robot is named", where="--port", expected="a device, socket://HOST:PORT or udp://HOST:PORT",
                         received="nothing",
                         hint="r2s2r doctor ports   # what to name, or set as link.port in project.toml")  # fmt: skip


def _chosen(
    project: Project, place: Iteration, names: Sequence[str], console: Console
) -> tuple[list[PolicyFile], list[InputRef]]:
    """The policies, each for this robot, and the plan where they are of it. Raises InputError, UsageError."""
    from r2s2r_cli.commands.outcome import require_input
    from r2s2r_cli.commands.simulate_inputs import Asked, read_policies, split_name
    from r2s2r_cli.stages.simulate.policies import sequence

    plan = place.artifact("plan")
    files = [text for text in names if is_file(text)]
    if not names or len(files) < len(names):
        require_input(plan, f"r2s2r plan --iteration {place.number}")
        _require_fresh(project, place, plan, console)
    for path in dict.fromkeys(split_name(text)[0] for text in files):
        _require_fresh_file(project, path, console)
    texts = [text if text in files else f"{plan}:{text}" for text in names or _long(plan)]
    found = [policy for text in texts for policy in read_policies(text, "execute")]
    for policy in found:
        sequence(policy, project.robot())
    return found, Asked(project, place, tuple(texts), None, 0, (), None).refs()


def is_file(text: str) -> bool:
    """Whether this names a file with policies; else it is a policy of the plan."""
    return Path(text).suffix in (".toml", ".h5") or ".h5:" in text


def _stored(project: Project, names: Sequence[str]) -> list[str]:
    """The policies as typed here, for the provenance."""
    from r2s2r_cli.commands.simulate_inputs import stored_names

    return [word for text in names for word in (stored_names(project, [text]) if is_file(text) else [text])]


def _require_fresh_file(project: Project, path: Path, console: Console) -> None:
    """The same for a policy that was named with its file, where that is a plan of this project; other files are taken
    as they are. Raises as `_require_fresh`."""
    from r2s2r_cli.store.header import whole_header

    place = next((one for one in project.iterations() if one.artifact("plan").resolve() == path.resolve()), None)
    if place is not None and path.exists() and whole_header(path).kind == "plan":
        _require_fresh(project, place, path, console)


def _long(plan: Path) -> list[str]:
    """The long policies of a plan; where it has none, the best gait of every behaviour."""
    from r2s2r_cli.store.read import read_artifact

    groups = read_artifact(plan, "plan")[1].groups
    if "long" in groups:
        return [name.decode() for name in groups["long"]["name"].tolist()]
    gaits = groups["primitives"]
    pairs = zip(gaits["behaviour"].tolist(), gaits["name"].tolist(), strict=True)
    best: dict[bytes, bytes] = {}
    for behaviour, name in pairs:
        best.setdefault(behaviour, name)
    return [name.decode() for name in best.values()]


def _require_fresh(project: Project, place: Iteration, plan: Path, console: Console) -> None:
    """Raises InputError where the plan was made for another robot.toml, model or settings than there are now; warns of
    what it was made from where that is stale itself, or where there are other states by now: its policies are still
    policies of this robot."""
    from r2s2r_cli.commands.asked_again import joined, unread
    from r2s2r_cli.commands.freshness import stale_inputs
    from r2s2r_cli.commands.wanted import wanted_again
    from r2s2r_cli.errors import InputError
    from r2s2r_cli.store.header import whole_header
    from r2s2r_cli.store.staleness import reasons

    header = whole_header(plan)
    found = reasons(project, header, wanted_again(project, place, header.provenance))
    new = joined(project, place, header.provenance)
    if project.relative(place.artifact("identification")) in unread(project, place, header.provenance):
        found += new
    if found:
        raise InputError(
            "the plan is stale: it was made for another robot or simulator than there is now",
            where=project.relative(plan), expected="a fresh plan", received="; ".join(found),
            hint=_planned_anew(project, place, plan, header),
        )  # fmt: skip
    for text in (*new, *stale_inputs(project, header.provenance.inputs)):
        console.warn(f"{project.relative(plan)}: {text}; `r2s2r status` says more")


def _planned_anew(project: Project, place: Iteration, plan: Path, header: Header) -> str:
    """What must be made first: `plan` refuses numbers of another robot.toml, for which `identify` comes before it."""
    from r2s2r_cli.commands.freshness import own_reasons
    from r2s2r_cli.commands.mend import mending
    from r2s2r_cli.store.again import command_again
    from r2s2r_cli.store.header import whole_header

    numbers = place.artifact("identification")
    if numbers.exists():
        made = whole_header(numbers)
        why = own_reasons(project, place, made)
        first = mending(project, made, numbers, why).command if why else ""
        if first:
            return first
    return command_again(header.provenance, plan)


def _ask(console: Console) -> None:
    """Raises UsageError where the answer is no."""
    from r2s2r_cli.commands.record_live import way_to_stop
    from r2s2r_cli.commands.typed import typed_again

    console.say(f"the robot will move now; {way_to_stop()}")
    if not typer.confirm("run these policies on the robot?", err=True):
        raise UsageError("nothing moved", where="r2s2r execute", expected="yes", received="no",
                         hint=typed_again("execute", "--dry-run"))  # fmt: skip
