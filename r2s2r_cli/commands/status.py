"""`r2s2r status`: what is fresh, what is stale and why, how much disk it takes, what to run next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import GateError, R2S2RError
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import reasons
from schemas.header import Header
from schemas.results import ArtifactState, StatusResult
from schemas.versions import KINDS


def status(
    check: Annotated[bool, typer.Option("--check", help="Leave with exit code 3 unless everything is fresh.")] = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Show the artifacts of the project: fresh or stale and why, and the disk they take.

    Decided by content hashes, settings and stage versions; file times and comments do not count.

    Example: r2s2r status --check
    """
    console = Console(json=json, quiet=quiet)
    here = Project.find(project)
    result = survey(here)
    console.document(result)
    console.data(f"project {result.project}   robot {result.robot}   {_size(result.bytes)}")
    rows = [
        [
            f"{a.iteration:03d}" if a.iteration else "-",
            a.stage,
            a.artifact,
            a.state,
            _size(a.bytes),
            "; ".join(a.reasons),
        ]
        for a in result.artifacts
    ]
    if rows:
        console.table("", ["iteration", "stage", "artifact", "state", "size", "why"], rows)
    if result.next:
        console.hint(result.next)
    unfit = [a for a in result.artifacts if a.state != "fresh"]
    if check and unfit:
        raise GateError(
            f"{len(unfit)} of {len(result.artifacts)} artifacts are not fresh",
            where=unfit[0].artifact,
            expected="fresh",
            received=f"{unfit[0].state}: {'; '.join(unfit[0].reasons)}",
            hint=result.next or "r2s2r status",
        )


def survey(project: Project) -> StatusResult:
    """The state of every artifact of a project, in the order of the data."""
    states: list[ArtifactState] = []
    stale: set[str] = set()
    places: list[tuple[Iteration | None, Path]] = [(None, project.root)]
    places += [(iteration, iteration.path) for iteration in project.iterations()]
    for iteration, directory in places:
        level = "project" if iteration is None else "iteration"
        for spec in KINDS.values():
            path = directory / spec.filename
            if spec.level == level and path.exists():
                states.append(_state(project, iteration, path, stale))
        states += [_unsealed(project, iteration, path) for path in project.journals() if path.parent == directory]
    return StatusResult(
        project=project.file.name,
        robot=project.robot().name,
        iterations=len(places) - 1,
        artifacts=tuple(states),
        bytes=sum(p.stat().st_size for p in project.root.rglob("*") if p.is_file()),
        next=_next(states),
    )


def _state(project: Project, iteration: Iteration | None, path: Path, stale: set[str]) -> ArtifactState:
    name, header, why = project.relative(path), None, []
    try:
        header = read_header(path)
        why = _reasons(project, iteration, header, stale)
        state = "stale" if why else "fresh"
    except R2S2RError as error:
        state, why = "damaged", [error.what]
    if state != "fresh":
        stale.add(name)
    return ArtifactState.model_validate(
        {
            "stage": header.provenance.stage if header else "?", "iteration": iteration.number if iteration else None,
            "artifact": name, "state": state, "reasons": tuple(why), "bytes": path.stat().st_size,
            "content_sha256": header.content_sha256 if header else None,
        }
    )  # fmt: skip


def _reasons(project: Project, iteration: Iteration | None, header: Header, stale: set[str]) -> list[str]:
    from r2s2r_cli.commands.stage import wanted_again

    found = reasons(project, header, wanted_again(project, iteration, header.provenance))
    upstream = [ref.path for ref in header.provenance.inputs if ref.path in stale]
    return found + [f"input {path} is stale itself" for path in upstream]


def _unsealed(project: Project, iteration: Iteration | None, path: Path) -> ArtifactState:
    return ArtifactState(
        stage="record", iteration=iteration.number if iteration else None, artifact=project.relative(path),
        state="unsealed", reasons=("the recording was cut off before it was sealed",), bytes=path.stat().st_size,
        content_sha256=None,
    )  # fmt: skip


def _next(states: list[ArtifactState]) -> str:
    for state in states:
        flag = f" --iteration {state.iteration}" if state.iteration else ""
        if state.state == "unsealed":
            return f"r2s2r recover {state.artifact}"
        if state.state == "damaged":
            return f"r2s2r validate {state.artifact}"
        if state.state == "stale" and state.stage == "estimate":
            return f"r2s2r estimate{flag}"
        if state.state == "stale":
            return f"r2s2r {state.stage} --help   # run it again on its source"
    stages = {state.stage for state in states}
    if not stages & {"import", "record"}:
        return "r2s2r import run.csv"
    return "" if "estimate" in stages else "r2s2r estimate"


def _size(count: int) -> str:
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000 or unit == "GB":
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1000
    raise AssertionError("unreachable")
