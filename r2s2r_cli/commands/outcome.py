"""What stage commands say: what became of an artifact, their settings, and that the stage before has not run."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.brief import brief
from r2s2r_cli.store.project import Project
from schemas.header import Header
from schemas.results import StageResult


def show_outcome(result: StageResult, console: Console) -> None:
    """Say on stderr what became of the artifact; with --json print the document."""
    console.document(result)
    words = {
        "done": f"wrote {result.artifact}",
        "fresh": f"{result.artifact} is fresh, nothing to do",
        "dry_run": f"would write {result.artifact}",
    }
    console.say(words[result.state])
    for reason in brief(result.reasons):
        console.say(f"  {'but' if result.state == 'fresh' else 'because'} {reason}")
    for text in result.stale_inputs:
        console.warn(f"{result.artifact}: {text}")
    if (result.state == "fresh" and result.reasons) or result.stale_inputs:
        console.hint("r2s2r status")
    for path in result.drawings:
        console.say(f"  drew {path}")
    if result.state == "dry_run":
        for path in result.inputs:
            console.say(f"  from {path}")


def require_input(path: Path, command: str | Callable[[], str]) -> None:
    """Raises ArtifactError where the stage before has not run. command: that makes it; asked for only then, where
    finding it takes a look at the folder."""
    if not path.exists():
        raise ArtifactError(
            "the artifact of the stage before is missing",
            where=str(path),
            expected=path.name,
            received="nothing",
            hint=command if isinstance(command, str) else command(),
        )


def require_model(project: Project, path: Path, command: str) -> Header:
    """The head of an identification that was named with --model. Raises ArtifactError where it is not there, or is
    something else. command: of the option."""
    from r2s2r_cli.commands.typed import typed_instead
    from r2s2r_cli.store.header import whole_header
    from r2s2r_cli.store.read import check_kind_and_version

    if path.is_file():
        header = whole_header(path)
        check_kind_and_version(path, header, "identification")
        return header
    places = [place.artifact("identification") for place in project.iterations()]
    there = [os.path.relpath(one) for one in places if one.exists()]
    raise ArtifactError(
        "there is no such identification", where="--model", expected=" | ".join(there) or "a 30-identify.h5",
        received=str(path), hint=typed_instead(command, str(path), there[-1]) if there else "r2s2r identify",
    )  # fmt: skip


def print_config(stage: str, settings: Mapping[str, Any], console: Console) -> None:
    """The effective settings on stdout, as a section of project.toml, or JSON with --json."""
    section = {key: value for key, value in settings.items() if key != "flags"}
    if console.json:
        import json

        console.raw(json.dumps(section, indent=2))
        return
    import tomlkit

    console.raw(tomlkit.dumps({stage: section}).rstrip())
