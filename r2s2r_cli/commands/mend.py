"""What mends a stale artifact: a command that can be run with what there is, or the reason why there is none."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.measured import MEASURED
from r2s2r_cli.store.again import BARE, command_again
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.staleness import input_reasons
from schemas.header import Header, InputRef
from schemas.versions import KINDS, STAGE_VERSIONS

MOVES = "moves nothing; without --dry-run, with --port, the robot runs them again"
"""Behind a command that shows runs: it mends nothing, what does is for people to decide."""


@dataclass(frozen=True)
class Mending:
    """command: makes the artifact fresh, or first an input of it that is missing. runs: shows, without moving a robot,
    the runs that would have to be made anew where no command on this machine can help. why_not: why that is so. All to
    be pasted in the project's directory, and empty where there is none."""

    command: str = ""
    runs: str = ""
    why_not: str = ""


def mending(project: Project, header: Header, path: Path, reasons: Sequence[str]) -> Mending:
    """What mends the stale artifact at `path`. reasons: why it is stale, other than through a stale input."""
    made = header.provenance
    if made.stage in MEASURED:  # nothing makes it again: a robot must move
        return Mending(runs=_runs(project, header, path))
    if made.stage not in STAGE_VERSIONS:  # its command line may be pasted nowhere, and is no hint
        return Mending(why_not=f"another program makes it: {shlex.join(made.argv)}")
    lost = sorted((ref for ref in made.inputs if not (project.root / ref.path).exists()), key=lambda ref: ref.path)
    sources = [ref.path for ref in lost if ref.kind not in KINDS]
    if sources:
        return Mending(why_not=f"it cannot be made again: {', '.join(sources)} is not kept")
    if lost:
        return _missing(project, lost[0])
    if made.stage == "estimate":
        older = len(reasons) == 1 and made.stage_version != STAGE_VERSIONS["estimate"]
        found = _estimated(project, project.root / made.inputs[0].path, older=older)
        if found is not None and not found.command and found.why_not and of_another(project, path):
            return replace(found, why_not=f"{found.why_not}; these states are of another recording than that")
        if found is not None:
            return found
    return Mending(command_again(made, path))


def sighted(datasets: Iterable[str]) -> bool:
    """Whether states can be estimated from a recording with these datasets: it holds pictures, or end caps."""
    return any(name.endswith("/caps/p_WE") or "/camera/depth" in name for name in datasets)


def blind(project: Project, recording: Path) -> str:
    """Why no states can be estimated from a recording; empty: they can. Raises ArtifactError where it is damaged."""
    header, name = read_header(recording), project.relative(recording)
    if sighted(header.datasets):
        return ""
    made = header.provenance
    # Where pictures were taken out, the times of them stay.
    if made.settings.get("flags", {}).get("camera") or any("/camera/" in one for one in header.datasets):
        return f"the pictures or end caps of {name} are not kept"
    return (
        f"{name} was recorded without a camera" if made.stage in MEASURED else f"{name} holds no end caps, no pictures"
    )


def of_another(project: Project, estimate: Path) -> bool:
    """Whether states are of another recording than the one that is there under its name. Raises ArtifactError where
    they are damaged."""
    return any(
        input_reasons(project, ref) for ref in read_header(estimate).provenance.inputs if ref.kind == "recording"
    )


def _estimated(project: Project, recording: Path, *, older: bool = False) -> Mending | None:
    """What makes up for a recording that no states can be estimated from; None: they can. older: there are states from
    it, which only an older version of the stage made: no reason to move a robot."""
    try:
        header, why = read_header(recording), blind(project, recording)
    except R2S2RError:
        return Mending()  # damaged: that is said of the recording, with its own way out
    if not why:
        return None
    made = header.provenance
    if made.stage == "import" and all((project.root / ref.path).exists() for ref in made.inputs):
        return Mending(command_again(made, recording, force=True), why_not=why)
    if older:
        return Mending(why_not=f"it cannot be made again here, and remains usable: {why}")
    return Mending(runs=_runs(project, header, recording), why_not=f"it cannot be made again: {why}")


def _missing(project: Project, ref: InputRef) -> Mending:
    """What makes an artifact that is not there, and that another was made from."""
    why = f"{ref.path} must be made first"
    path = project.root / ref.path
    place = next((one for one in project.iterations() if one.path == path.parent), None)
    if place is None or ref.kind not in BARE:
        return Mending(why_not=why)
    executed = ref.kind == "estimate" and path.name == KINDS["estimate"].executed
    if ref.kind == "estimate":
        recording = place.artifact("recording", executed=executed)
        found = _estimated(project, recording) if recording.exists() else Mending()
        if found is not None:
            return Mending(found.command, found.runs, why)
    words = ["r2s2r", BARE[ref.kind], *(["--of", "execute"] if executed else []), "--iteration", str(place.number)]
    return Mending(shlex.join(words), why_not=why)


def _runs(project: Project, header: Header, path: Path) -> str:
    """The runs of a recording once more, without the robot; empty where their policies are not there any more."""
    from r2s2r_cli.commands.execute import is_file
    from r2s2r_cli.commands.simulate_inputs import split_name

    made = header.provenance
    if made.stage == "import":
        return ""
    policies = made.settings.get("flags", {}).get("policies", ())
    files = [text for text in policies if made.stage == "record" or is_file(text)]
    if not all((project.root / split_name(text)[0]).exists() for text in files):
        return ""
    if made.stage == "execute" and (len(files) < len(policies) or not policies):  # those of a plan
        if not path.with_name(KINDS["plan"].filename).exists():
            return ""
        if any(input_reasons(project, ref) for ref in made.inputs):  # it may hold others by now
            words = ["r2s2r", "execute", "--iteration", str(int(path.parent.name)), "--force", "--dry-run"]
            return f"{shlex.join(words)}   # {MOVES}"
    return f"{command_again(made, path, force=True, dry_run=True)}   # {MOVES}"
