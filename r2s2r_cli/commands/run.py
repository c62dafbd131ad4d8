"""`r2s2r run`: all stages of an iteration, one after the other; what is fresh is not made again."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from r2s2r_cli.commands.asking import require_answer
from r2s2r_cli.commands.robot_link import PortOption, ProtocolOption, link_of
from r2s2r_cli.commands.run_again import Typed, cut_off, robot_again, warn_of_old
from r2s2r_cli.commands.run_stage import carry_out
from r2s2r_cli.console import Console
from r2s2r_cli.errors import R2S2RError, UsageError
from r2s2r_cli.options import DrawOption, DryRunOption, IterationOption, JsonOption, ProjectOption, QuietOption
from r2s2r_cli.reached import reached
from r2s2r_cli.store.project import Iteration, Project

STAGES = ("record", "estimate", "identify", "plan", "execute", "estimate-executed", "compare")
"""In their order; `import` takes the place of `record` where logs are given."""


@dataclass(frozen=True)
class Step:
    """One stage: its command without `r2s2r`, and the artifact that it makes. robot: it moves the robot, and is not
    done again where its artifact is there."""

    name: str
    words: tuple[str, ...]
    target: Path
    robot: bool = False


def run(
    source: Annotated[
        list[Path] | None,
        typer.Argument(help="Logs to import instead of recording.", show_default=False),
    ] = None,
    port: PortOption = None,
    protocol: ProtocolOption = None,
    camera: Annotated[
        str | None, typer.Option("--camera", metavar="CAMERA", help="realsense[:SERIAL], open3d or rig://HOST:PORT.")
    ] = None,
    random: Annotated[int, typer.Option("--random", metavar="N", help="Targets of the random policy to record.")] = 15,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random policy, of identify and of plan.")] = 0,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            "--policy", metavar="NAME", help="Policy of the plan to execute; repeatable. Default: the long ones."
        ),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", metavar="N", help="Execute every policy N times.")] = 1,
    until: Annotated[
        str, typer.Option("--until", metavar="STAGE", help=f"Stop after this stage: {', '.join(STAGES)}.")
    ] = STAGES[-1],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the robot executes the plan.")] = False,
    project: ProjectOption = None,
    iteration: IterationOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    draw: DrawOption = True,
    dry_run: DryRunOption = False,
) -> None:
    """Record (or import), estimate, identify, plan, execute, estimate again and compare: one iteration of the loop.

    Every stage is the command of that name; a fresh one says so and costs nothing, one that was interrupted goes on
    where it was, a robot that has moved is not moved again. A recording that was cut off, and that nothing was made of
    yet, is done again; what it holds is kept. The first stage that fails ends the run, with its code, and so does what
    `validate` finds wrong with runs and their states (3): nothing is learned from them.

    Example: r2s2r run --port /dev/ttyUSB0 --protocol legacy --camera realsense
    """  # fmt: skip
    from schemas.results import RunResult, RunStep

    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    place = here.iteration(iteration, create=True)
    if until not in STAGES:
        raise UsageError("there is no such stage", where="--until", expected=" | ".join(STAGES), received=until,
                         hint=f"--until {STAGES[-1]}")  # fmt: skip
    _require(tuple(source or ()), random, repeats)
    # Whoever imports a log named no robot, and none is to move by surprise.
    link = link_of(here, port, protocol)
    asked = port or (None if source else link.port)
    if asked is None and camera is not None:
        instead = [*map(str, source)] if source else ["--port", "/dev/ttyUSB0", "--camera", camera]
        raise UsageError("a camera looks at a robot, and none is named", where=f"--camera {camera}",
                         expected="--port PORT beside it, or no camera", received="no port",
                         hint=shlex.join(["r2s2r", "run", *instead, "--iteration", str(place.number)]))  # fmt: skip
    robot: tuple[str, ...] = () if asked is None else ("--port", asked, "--protocol", link.protocol)
    robot += () if camera is None else ("--camera", camera)
    names = tuple(policy or ())
    steps = list(_steps(here, place, tuple(source or ()), robot, (random, seed), names, repeats, yes=yes))
    steps = [step for step in steps if STAGES.index(step.name) <= STAGES.index(until)]
    if not dry_run and any(step.name == "execute" and _moves(place, step, robot) for step in steps):
        require_answer("run", yes=yes)  # now, not after the stages before it
    typed = Typed(asked, link.protocol, camera, names, repeats, (random, seed))
    common = ("--project", str(here.root), "--iteration", str(place.number), *(("--quiet",) if quiet else ()),
              *(() if draw else ("--no-draw",)))  # fmt: skip
    went: list[RunStep] = []

    def note(step: Step, state: Literal["done", "kept", "dry_run"], words: Sequence[str]) -> None:
        name = here.relative(step.target)
        went.append(RunStep(stage=step.name, state=state, artifact=name, command=shlex.join(words)))

    for number, step in enumerate(steps, start=1):
        resumed = _resumed(step)
        words = ("r2s2r", *step.words, "--iteration", str(place.number), *resumed)
        if step.robot and step.target.exists():
            name, again = here.relative(step.target), (*step.words, "--force")
            why = cut_off(step.target)
            if not _moves(place, step, robot):
                console.say(f"[{number}/{len(steps)}] {name} is there: the robot is not moved again")
                warn_of_old(here, step.target, typed, console)
                if why:
                    shown = robot_again(here, step.target, typed)
                    console.warn(f"{name} was cut off ({why}); to do it again: {shown}")
                note(step, "kept", words)
                continue
            console.say(f"[{number}/{len(steps)}] {name} was cut off ({why}): it is done again, and kept as .replaced")
            words, step = ("r2s2r", *again, "--iteration", str(place.number)), replace(step, words=again)
        if why := _kept(here, place, step, steps):
            console.say(f"[{number}/{len(steps)}] {here.relative(step.target)} is used as it is: {why}")
            note(step, "kept", words)
            continue
        console.say(f"[{number}/{len(steps)}] {shlex.join(words)}")
        note(step, "dry_run" if dry_run else "done", words)
        if dry_run:
            continue
        carry_out((*step.words, *common, *resumed), shlex.join(words), robot=step.robot, json=json)
        _gate(place, step, json=json)
    console.document(RunResult(iteration=place.number, stages=tuple(went)))
    if dry_run:
        console.say("nothing was done")


def _require(source: Sequence[Path], random: int, repeats: int) -> None:
    """What a stage would refuse only after those before it, and a dry run never. Raises InputError, UsageError."""
    from r2s2r_cli.stages.import_ import check_source
    from r2s2r_cli.stages.record.plan import require_repeats
    from r2s2r_cli.stages.simulate.policies import require_length

    require_length(random)
    require_repeats(repeats)
    for path in source:
        check_source(path)


def _moves(place: Iteration, step: Step, robot: Sequence[str]) -> bool:
    """Whether the robot does this step: it has not yet, or was cut off at it and nothing was made of that. What
    somebody went on from is theirs to judge."""
    if not step.target.exists():
        return step.robot
    used = place.artifact("estimate", executed=step.name == "execute").exists()
    return step.robot and bool(robot) and not used and bool(cut_off(step.target))


def _gate(place: Iteration, step: Step, *, json: bool) -> None:
    """What was recorded and estimated must pass `validate` before anything is learned from it. Leaves with its code."""
    if step.words[0] != "estimate" or not step.target.exists():
        return
    recording = place.artifact("recording", executed=step.name == "estimate-executed")
    files = [os.path.relpath(path) for path in (recording, step.target) if path.exists()]
    carry_out(("validate", *files, "--quiet"), shlex.join(["r2s2r", "validate", *files]), robot=False, json=json)


def _steps(
    project: Project, place: Iteration, source: Sequence[Path], robot: tuple[str, ...],
    random: tuple[int, int], policies: tuple[str, ...], repeats: int, *, yes: bool,
) -> Iterator[Step]:  # fmt: skip
    """The stages of this iteration. random: targets of the random policy, and the seed. Without a robot and without
    logs an iteration learns from the runs before it."""
    seeded = ("--seed", str(random[1])) if random[1] else ()
    recording, executed = place.artifact("recording"), place.artifact("recording", executed=True)
    before = [one for one in project.iterations() if one.number < place.number]
    earlier = any(one.artifact("estimate", executed=ran).exists() for one in before for ran in (False, True))
    if source:
        yield Step("record", ("import", *map(str, source)), recording)
    elif robot and not earlier:
        yield Step("record", ("record", "--random", str(random[0]), *seeded, *robot), recording, robot=True)
    elif not earlier and not recording.exists():
        raise UsageError("there is neither a robot nor a log", where="r2s2r run", expected="--port PORT, or log files",
                         received="neither", hint=_brought(project))  # fmt: skip
    if source or recording.exists() or not earlier:
        yield Step("estimate", ("estimate",), place.artifact("estimate"))
    yield Step("identify", ("identify", *seeded), place.artifact("identification"))
    yield Step("plan", ("plan", *seeded), place.artifact("plan"))
    if robot or executed.exists():
        words = ("execute", *policies, "--repeats", str(repeats), *robot, *(("--yes",) if yes else ()))
        yield Step("execute", words, executed, robot=True)
        yield Step("estimate-executed", ("estimate", "--of", "execute"), place.artifact("estimate", executed=True))
    if robot or executed.exists() or source or recording.exists() or not earlier:
        yield Step("compare", ("compare",), place.artifact("comparison"))


def _brought(project: Project) -> str:
    """The loop from a log that lies here, else from the robot."""
    first, log = project.first_data(), "r2s2r import "
    return f"r2s2r run {first.removeprefix(log) if first.startswith(log) else reached(project.file.link)}"


def _kept(project: Project, place: Iteration, step: Step, steps: Sequence[Step]) -> str:
    """Why states that are there are not estimated again: their pictures are gone, and no step brings them back."""
    from r2s2r_cli.commands.mend import blind, of_another

    executed = step.name == "estimate-executed"
    recording = place.artifact("recording", executed=executed)
    if step.words[0] != "estimate" or not step.target.exists() or not recording.exists():
        return ""
    if any(one.target == recording and not one.robot for one in steps):  # imported again, where it is stale
        return ""
    try:
        why, other = blind(project, recording), of_another(project, step.target)
    except R2S2RError:  # damaged: the stage says so
        return ""
    also = ", and these states are of another recording than that" if other else ""
    return why and f"it cannot be made again here, {why}{also}"


def _resumed(step: Step) -> tuple[str, ...]:
    """`--resume` where there is something to go on from."""
    from r2s2r_cli.commands.unfinished import RESUMED
    from r2s2r_cli.store.checkpoint import checkpoint_of, head_of

    there = step.name in RESUMED.values() and head_of(checkpoint_of(step.target)) is not None
    return ("--resume",) if there else ()
