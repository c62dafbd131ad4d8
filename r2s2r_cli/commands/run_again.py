"""Recordings that `run` finds: what ended them, what has changed since, and the command that makes them again."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.console import Console
from r2s2r_cli.errors import R2S2RError, quoted
from r2s2r_cli.measured import MEASURED
from r2s2r_cli.store.again import command_again
from r2s2r_cli.store.from_here import project_option
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from schemas.header import Provenance
from schemas.versions import KINDS


@dataclass(frozen=True)
class Typed:
    """What the command line of `run` says of a robot. Its usual values (None, none, one repeat) count as not said:
    what was recorded holds. random: targets and seed of the random policy, where nothing else says what to record."""

    port: str | None = None
    protocol: str = "checked"
    camera: str | None = None
    policies: tuple[str, ...] = ()
    repeats: int = 1
    random: tuple[int, int] = (15, 0)


def robot_again(project: Project, target: Path, typed: Typed) -> str:
    """The command that makes the recording at `target` again, of the same iteration, policies, repeats and camera. It
    names no --yes: nothing moves by a pasted line before somebody was asked."""
    made = read_header(target).provenance
    if made.stage in MEASURED:
        made = _measured(project, made, target, typed)
    return " ".join([command_again(made, target, force=True), *map(quoted, project_option(project.root))])


def warn_of_old(project: Project, target: Path, typed: Typed, console: Console) -> None:
    """Runs whose plan or policies have become others since: they are compared as what they are, and it is said."""
    from r2s2r_cli.store.staleness import input_reasons

    made = read_header(target).provenance
    changed = [text for ref in made.inputs for text in input_reasons(project, ref)]
    if changed:
        way = "To import it again" if made.stage == "import" else "To run the present policies"
        console.warn(
            f"{project.relative(target)} holds runs of what has changed since: {'; '.join(changed)}. "
            f"{way}: {robot_again(project, target, typed)}"
        )


def cut_off(target: Path) -> str:
    """What ended a recording before its last run was through; empty: nothing, or it cannot be read, which the stage
    that reads it says."""
    try:
        made = read_header(target).provenance
    except R2S2RError:
        return ""
    if made.stage in MEASURED and not made.report:
        return "recovered after a crash"
    runs = [one for one in made.report.get("runs", ()) if one.get("ended", "complete") != "complete"]
    early = [f"{one['run']}: {one['ended']}" for one in runs]
    early += [f"{name}: not begun" for name in made.report.get("not_begun", ())]
    return "; ".join(early)


def _measured(project: Project, made: Provenance, target: Path, typed: Typed) -> Provenance:
    """The provenance with what was typed in the place of what was recorded."""
    flags, seed = dict(made.settings.get("flags", {})), made.seed
    if typed.port is not None:
        flags |= {"port": typed.port, "protocol": typed.protocol}
    if typed.camera is not None:
        flags["camera"] = typed.camera
    if made.stage == "record":
        if not any(flags.get(key) for key in ("policies", "random", "excite")):
            flags["random"], seed = typed.random
    else:
        flags["policies"] = typed.policies or _still_there(flags.get("policies") or (), target)
        if typed.repeats != 1:
            flags["repeats"] = typed.repeats
        own = project.relative(target.with_name(KINDS["identification"].filename))
        if flags.get("model") == own:  # what it takes by itself
            flags["model"] = None
    flags["policies"] = _from_here(project, flags.get("policies") or ())
    return made.model_copy(update={"settings": {**made.settings, "flags": flags}, "seed": seed})


def _still_there(names: Sequence[str], target: Path) -> tuple[str, ...]:
    """The policies that were run; none, which stands for the long ones, where the plan of today lacks one of them."""
    from r2s2r_cli.commands.execute import is_file
    from r2s2r_cli.commands.simulate_inputs import read_policies

    plan = target.with_name(KINDS["plan"].filename)
    try:
        for name in names:
            if not is_file(name):
                read_policies(f"{plan}:{name}", "execute")
    except R2S2RError:
        return ()
    return tuple(names)


def _from_here(project: Project, names: Sequence[str]) -> list[str]:
    """Policies as they are named from the working directory: files are kept as seen from the project's."""
    from r2s2r_cli.commands.execute import is_file

    moved = Path.cwd().resolve() != project.root.resolve()
    return [os.path.relpath(project.root / name) if moved and is_file(name) else name for name in names]
