"""Does an artifact belong where it lies, and to what it was made from?"""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.checks.base import Found, check
from r2s2r_cli.checks.subjects import Journals, Links
from r2s2r_cli.errors import UPDATE_CLONE, quoted
from r2s2r_cli.measured import CONTENT, MEASURED, changed
from schemas.versions import KINDS

_IN_BODY = {"kind", "schema_version", "title", "created_by", "content_sha256", "seal_sha256"}
"""What of the head stands in the root attributes too; the rest describes the body and cannot be in it."""
_SHOWN = 60
"""Characters of a value in a message."""


@check(
    "error",
    Links,
    what="the head of the file says the same as its HDF5 body: kind, version, title, content hash, provenance",
    why="the head is what `status` and `inspect` read; a head of another file would lie about this one",
    fix="r2s2r recover {file}",
)
def head_matches_body(links: Links) -> Iterator[Found]:
    """Facts that stand twice in the file, and differ."""
    head = links.header.model_dump(mode="json", include=_IN_BODY)
    made, stated = links.header.provenance.model_dump(mode="json"), links.header.provenance.model_fields_set
    record = {f"provenance/{key}": (value, key in stated) for key, value in made.items()}
    for name, (value, said) in {**{key: (value, True) for key, value in head.items()}, **record}.items():
        if not said and name not in links.body:
            continue  # a field that is younger than the file
        received = links.body.get(name)
        if received != value:
            yield Found(name, "the head of the file and its body differ", _short(value), _short(received))


@check(
    "error",
    Links,
    what="the artifacts that this one was made from are there and hold what they held then",
    why="states of one run beside the raw data of another are silent nonsense",
    fix="r2s2r status",
)
def inputs_match(links: Links) -> Iterator[Found]:
    """Input artifacts that are gone, or hold something else than what was computed from them."""
    made = links.header.provenance.stage
    for state in links.inputs:
        ref = state.ref
        if ref.kind not in KINDS:
            continue
        if state.sha256 is None:
            yield Found(
                "provenance/inputs", "an artifact that it was made from cannot be read", ref.path, state.problem
            )
        elif state.sha256 != ref.sha256 and made not in MEASURED:
            yield Found("provenance/inputs", changed(ref.path, made, CONTENT), f"sha256 {ref.sha256[:16]}, as it was",
                        f"sha256 {state.sha256[:16]}")  # fmt: skip


@check(
    "warning",
    Links,
    what="what a robot executed is of the plan that is there now",
    why="the runs are what the robot did, and stay so; but they are not runs of the present plan",
    fix="r2s2r status",
)
def plan_is_the_executed(links: Links) -> Iterator[Found]:
    """Measurements whose plan, or what it was made from, was made anew since."""
    made = links.header.provenance.stage
    for state in links.inputs if made in MEASURED else ():
        ref = state.ref
        if ref.kind in KINDS and state.sha256 is not None and state.sha256 != ref.sha256:
            yield Found("provenance/inputs", changed(ref.path, made, CONTENT), f"sha256 {ref.sha256[:16]}, as it was",
                        f"sha256 {state.sha256[:16]}")  # fmt: skip


@check(
    "warning",
    Links,
    what="the source file or folder, where it is still there, is the one that was read",
    why="the artifact is sound, but the source beside it no longer gives it",
    fix="r2s2r status",
)
def source_unchanged(links: Links) -> Iterator[Found]:
    """Sources from outside that changed. One that is gone is no fault: the artifact holds all of it."""
    for state in links.inputs:
        ref = state.ref
        if ref.kind not in KINDS and state.sha256 is not None and state.sha256 != ref.sha256:
            yield Found("provenance/inputs", f"the source {ref.path} has changed since it was read", ref.sha256[:16],
                        state.sha256[:16])  # fmt: skip


@check(
    "error",
    Links,
    what="the data are of the robot that robot.toml describes",
    why="lengths, caps and cables of one robot mean nothing on another",
    fix="set robot in project.toml to the description of this robot, or make a project of its own for it",
)
def robot_is_the_projects(links: Links) -> Iterator[Found]:
    """Data of another robot."""
    for location, name in links.robots.items():
        if links.project_robot is not None and name != links.project_robot:
            yield Found(f"{location}@robot", "the data are of another robot", links.project_robot, name)


@check(
    "warning",
    Links,
    what="the stage that made it is not newer than this r2s2r knows",
    why="this r2s2r would make something else from the same input, and call the newer result stale",
    fix=UPDATE_CLONE,
)
def stage_not_newer(links: Links) -> Iterator[Found]:
    """Made by a newer r2s2r of the same schema version."""
    made = links.header.provenance
    known = links.stage_versions.get(made.stage)
    if known is not None and made.stage_version > known:
        yield Found("provenance/stage_version", f"stage {made.stage} of a newer r2s2r made it", f"at most {known}",
                    str(made.stage_version))  # fmt: skip


@check(
    "warning",
    Links,
    what="an artifact in the place of one kind is of that kind",
    why="the next stage looks for its input by file name",
    fix="mv -n {file} {file}.aside && r2s2r status   # says what makes again what belongs there",
)
def name_fits_kind(links: Links) -> Iterator[Found]:
    """A recording under the name of an estimate, and the like."""
    wanted = {name: spec.kind for spec in KINDS.values() for name in spec.filenames}.get(links.filename)
    if wanted is not None and wanted != links.kind:
        hint = f"mv -n {{file}} {quoted(links.belongs)}" if links.belongs else ""
        yield Found("kind", "the file has the name of another kind", f"{wanted} in {links.filename}", links.kind, hint)


@check(
    "warning",
    Journals,
    what="every recording was sealed",
    why="a journal is a recording that was cut off: its rows are there, but no other command reads them",
    fix="r2s2r recover {location}",
)
def recordings_sealed(journals: Journals) -> Iterator[Found]:
    """Journals left behind by a killed process."""
    for path in journals.paths:
        yield Found(path, "a recording was cut off before it was sealed", "an artifact", "its journal")


def _short(value: object) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
