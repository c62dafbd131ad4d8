"""Hints of `estimate` as commands of this project: the stage knows neither paths nor how the runs were made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.reached import RIG_REMARK, camera
from schemas.header import Provenance


@contextmanager
def hints_of(source: str, path: Path, made: Provenance, *, rig: bool = False) -> Iterator[None]:
    """An error on the way leaves with a hint that can be pasted in the project. source: the recording in words. rig: it
    is of a rig, whose camera is its own."""
    from r2s2r_cli.stages.estimate.unseen import Unseen

    try:
        yield
    except R2S2RError as error:
        if isinstance(error, Unseen):
            error.hint = seen_again(made, path, rig=rig) or error.hint
        error.hint = error.hint.replace("10-record.h5", source)
        raise


def seen_again(made: Provenance, path: Path, *, rig: bool = False) -> str:
    """The command that made the recording, so that pictures come with it; nothing where no stage made it.

    `execute` asks before the robot moves; `record` does not, and no robot moves because a hint was pasted.
    """
    from r2s2r_cli.store.again import command_again

    if made.stage not in ("record", "execute", "import"):
        return ""
    again = command_again(made, path, force=True)
    if made.stage == "import":
        return again + "   # with end caps, or with color/ and depth/ in the folder"
    remarks = []
    if "--camera" not in again.split():
        again += f" {camera(rig=rig)}"
        remarks += [RIG_REMARK] if rig else []
    if made.stage == "record":
        again += " --dry-run"
        remarks.append("--dry-run moves nothing; without it the robot does")
    return again + (f"   # {'; '.join(remarks)}" if remarks else "")
