"""An identification as another command's input: read, and refused where robot.toml or `identify` changed since."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from r2s2r_cli.errors import InputError

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.store.project import Project


def read_numbers(project: Project, path: Path) -> ArtifactData:
    """The identification at `path`. Raises ArtifactError; InputError where robot.toml was changed since, in a part that
    the numbers depend on: they would then be mixed with others; or where another version of `identify` made them."""
    from r2s2r_cli.commands.wanted import robot_part
    from r2s2r_cli.store.project import iteration_number
    from r2s2r_cli.store.read import read_artifact
    from schemas.versions import STAGE_VERSIONS

    header, data = read_artifact(path, "identification")
    made = header.provenance
    if made.stage != "identify":
        return data
    number = iteration_number(path.resolve().parent)
    again = "r2s2r identify" + ("" if number is None else f" --iteration {number}")
    version = STAGE_VERSIONS["identify"]
    if made.stage_version != version:
        raise InputError(
            "the parameters are of another version of identify", where=project.relative(path),
            expected=f"version {version}", received=f"version {made.stage_version}", hint=again,
        )  # fmt: skip
    now = robot_part("identify", project.robot())
    changed = [name for name in now if made.robot.get(name) != now[name]]
    if changed:
        raise InputError(
            "the parameters were identified with another version of robot.toml", where=project.relative(path),
            expected="robot.toml as it is now", received=f"another {', '.join(changed)}", hint=again,
        )  # fmt: skip
    return data
