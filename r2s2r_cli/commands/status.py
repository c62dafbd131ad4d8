"""`r2s2r status`: what is fresh, what is stale and why, how much disk it takes, what to run next."""

from __future__ import annotations

import shlex
import stat
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.commands.latest_gap import latest_gap
from r2s2r_cli.commands.mend import Mending, mending
from r2s2r_cli.commands.next_command import explained, forward
from r2s2r_cli.commands.unfinished import UNDER_WAY, Kept, checkpoints, interrupted, unsealed
from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError, GateError
from r2s2r_cli.measured import MEASURED, itself_unfresh
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from r2s2r_cli.store.again import stage_at
from r2s2r_cli.store.brief import brief
from r2s2r_cli.store.from_here import typed_here
from r2s2r_cli.store.header import CutOff, NotAnArtifact, read_header, sealed_header, whole_header
from r2s2r_cli.store.lock import writer
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import Header, Provenance
from schemas.results import ArtifactState, StatusResult
from schemas.versions import KINDS


def status(
    check: Annotated[
        bool, typer.Option("--check", help="Compare every byte with its seal; exit code 3 unless everything is fresh.")
    ] = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Show the artifacts of the project: fresh or stale and why, and the disk they take.

    Decided by content hashes, settings and stage versions; file times and comments do not count. Of each file the head
    and the size are read: bytes that changed inside are seen with --check alone.

    Example: r2s2r status --check
    """
    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    result = _typed_here(survey(here, thorough=check), here.root)
    console.document(result)
    console.data(f"project {result.project}   robot {result.robot}   {_size(result.bytes)}")
    rows = [
        [f"{a.iteration:03d}" if a.iteration else "-", a.stage, a.artifact, a.state, _size(a.bytes), _remarks(a)]
        for a in result.artifacts
    ]
    if rows:
        console.table("", ["iteration", "stage", "artifact", "state", "size", "why"], rows)
        # On lines of their own: a cell of the table breaks a command, and the hint below is of one artifact.
        mends = list(dict.fromkeys(a.mend for a in result.artifacts if a.mend))
        if len(mends) > 1:
            console.say("\n".join(["to mend what is damaged, one by one:", *(f"  {mend}" for mend in mends)]))
        if not check:
            console.say("heads and sizes were read, contents were not; to compare every byte: r2s2r status --check")
    gap = latest_gap(here)
    if gap is not None:
        from r2s2r_cli.views.compare_history import history_table

        shown = history_table(gap)
        if shown is not None:
            console.table(shown.title, shown.columns, shown.rows)
    if result.next:
        console.hint(result.next)
    unfit = [a for a in result.artifacts if a.state not in ("fresh", *UNDER_WAY)]
    if check and unfit:
        damaged = [a for a in unfit if a.state == "damaged"]  # of which the others may be stale
        first, also = (damaged or unfit)[0], f", {len(damaged)} damaged" if damaged else ""
        raise GateError(
            f"{len(unfit)} of {len(result.artifacts)} artifacts are not fresh{also}",
            where=first.artifact,
            expected="fresh",
            received=f"{first.state}: {'; '.join(brief(first.reasons))}",
            hint=result.next or "r2s2r status",
        )


def _typed_here(result: StatusResult, root: Path) -> StatusResult:
    """With its commands as they are typed where this runs."""
    artifacts = tuple(one.model_copy(update={"mend": typed_here(one.mend, root)}) for one in result.artifacts)
    return result.model_copy(update={"artifacts": artifacts, "next": typed_here(result.next, root)})


LATER = {KINDS["floor"].filename: 1, KINDS["policy"].filename: 1, KINDS["comparison"].filename: 2,
         KINDS["diagnosis"].filename: 2}  # fmt: skip
"""Artifacts that read others which stand below them in the list."""
_RECOVER = "r2s2r recover "


def survey(project: Project, *, thorough: bool = False) -> StatusResult:
    """The state of every artifact of a project, in the order of the data.

    Heads and sizes are read, with `thorough` every byte. Raises InputError for wrong settings.
    """
    iterations = {iteration.path: iteration for iteration in project.iterations()}
    journals = project.journals()
    kept = checkpoints(project)
    again: list[str] = []
    runs: list[str] = []
    unfresh: dict[str, str] = {}
    listed = project.artifacts()
    # As they are read: what is made of the runs of all iterations is after them, and before what reads it.
    found = {path: _going_on(*_state(project, iterations.get(path.parent), path, unfresh, thorough), kept)
             for path in sorted(listed, key=lambda path: LATER.get(path.name, 0))}  # fmt: skip
    states = [found[path][0] for path in listed]
    # A stage that reads what is damaged fails: what brings that back comes first, in the order in which it is read.
    damaged = [path for path, (state, _) in found.items() if state.state == "damaged"]
    for _, mend in (found[path] for path in [*damaged, *(path for path in listed if path not in damaged)]):
        again += [mend.command] if mend.command else []
        runs += [mend.runs] if mend.runs else []
    busy = writer(project.root) if journals or kept else None
    states += [unsealed(project, iterations.get(path.parent), path, busy) for path in journals]
    states += [interrupted(one, busy) for one in kept.values()]
    if busy is None:
        again = [f"{_RECOVER}{shlex.quote(project.relative(path))}" for path in journals] + again
        again += [one.command for one in kept.values()]
    return StatusResult(
        project=project.file.name,
        robot=project.robot().name,
        iterations=len(iterations),
        artifacts=tuple(states),
        bytes=sum(_bytes_of(path) for path in project.root.rglob("*")),
        next=again[0] if again else forward(project) or next(iter(runs), explained(project)),
        history=gap.history if (gap := latest_gap(project)) else (),
    )  # fmt: skip


def _bytes_of(path: Path) -> int:
    """Bytes of a file; 0 of anything else, and of what another process has removed since it was listed."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return 0
    return found.st_size if stat.S_ISREG(found.st_mode) else 0


def _state(
    project: Project, iteration: Iteration | None, path: Path, unfresh: dict[str, str], thorough: bool
) -> tuple[ArtifactState, Mending]:
    """The line of one artifact, and what mends it; nothing where it is fresh."""
    name = project.relative(path)
    header: Header | None = None
    try:
        header = sealed_header(path) if thorough else whole_header(path)
    except ArtifactError as error:
        state, why, mend = "damaged", [error.what], Mending(_mends(error, path, name))
    else:
        own, upstream = _reasons(project, iteration, header, unfresh)
        # Stale through an input alone: made from the same input again it would be the same. And of a measurement under
        # an older plan nothing is to be mended.
        mend = mending(project, header, path, own) if own and header.provenance.stage not in MEASURED else Mending()
        why = own + ([mend.why_not] if mend.why_not else []) + upstream
        state = "stale" if why else "fresh"
    if state != "fresh":
        unfresh[name] = state
    made = header.provenance if header else None
    line = {
        "stage": made.stage if made else _stage(path), "iteration": iteration.number if iteration else None,
        "artifact": name, "state": state, "reasons": tuple(why), "mend": mend.command if state == "damaged" else "",
        "notes": _notes(made), "overrides": made.overrides if made else {}, "bytes": path.stat().st_size,
        "content_sha256": header.content_sha256 if header else None,
    }  # fmt: skip
    return ArtifactState.model_validate(line), mend


def _going_on(
    state: ArtifactState, mend: Mending, kept: Mapping[tuple[str, int | None], Kept]
) -> tuple[ArtifactState, Mending]:
    """The same, mended by going on where a checkpoint of it is kept: made anew, that would be lost. Looked at or
    recovered, it is not."""
    one = kept.get((state.stage, state.iteration))
    if one is None or not one.readable or not mend.command or mend.command.startswith((_RECOVER, "ls ")):
        return state, mend
    return state.model_copy(update={"mend": one.command if state.mend else ""}), replace(mend, command=one.command)


def _stage(path: Path) -> str:
    """The stage of a damaged artifact: as its head says, which may be whole, else as its place does."""
    try:
        return read_header(path).provenance.stage
    except ArtifactError:
        return stage_at(path)


def _mends(error: ArtifactError, path: Path, name: str) -> str:
    """What brings a damaged artifact back, or, where there is nothing in it or its end is gone, makes it again; of one
    that the system does not let us read, what shows why."""
    from r2s2r_cli.store.again import command_at
    from r2s2r_cli.store.verify import find_body

    if isinstance(error.__cause__, OSError):  # what may not be read, `recover` may not read either
        return error.hint
    if isinstance(error, CutOff) and not error.hint.startswith(_RECOVER):
        return error.hint
    nothing = isinstance(error, NotAnArtifact) and find_body(path) is None
    return (command_at(path) if nothing else "") or f"{_RECOVER}{shlex.quote(name)}"


def _reasons(
    project: Project, iteration: Iteration | None, header: Header, unfresh: Mapping[str, str]
) -> tuple[list[str], list[str]]:
    """Why an artifact is stale: by itself, and through inputs that are stale or damaged (unfresh: state by name)."""
    from r2s2r_cli.commands.freshness import own_reasons

    inputs, stage = [ref.path for ref in header.provenance.inputs], header.provenance.stage
    upstream = [itself_unfresh(path, stage, unfresh[path]) for path in inputs if path in unfresh]
    return own_reasons(project, iteration, header), upstream


def _remarks(state: ArtifactState) -> str:
    made = [f"made with --set {key}={value}" for key, value in state.overrides.items()]
    return "; ".join([*brief(state.reasons), *state.notes, *made])


def _notes(made: Provenance | None) -> tuple[str, ...]:
    """Runs of a recording that ended before their last target. They are measurements: nothing is stale by it."""
    runs = made.report.get("runs", ()) if made is not None and made.stage in MEASURED else ()
    return tuple(
        f"{run['run']} ended at target {run['targets_done'] + 1} of {run['targets']}: {run['ended']}"
        for run in runs if run.get("ended", "complete") != "complete"
    )  # fmt: skip


def _size(count: int) -> str:
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000 or unit == "GB":
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1000
    raise AssertionError("unreachable")
