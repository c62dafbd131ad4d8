"""What `rig` prints with `--json`: once, as soon as hosts can connect."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen


class RigResult(Frozen):
    """Where the rig can be reached; or, with `--points`, the table that was written."""

    schema_: Literal["r2s2r.rig/1"] = Field(default="r2s2r.rig/1", alias="schema")
    robot: str
    device: str | None = None
    """Device or URL to give to `record` and `doctor`."""
    protocol: str | None = None
    boards: int | None = None
    lock_step: bool | None = None
    """Time goes on with the ticks that the host asks for, and with nothing else."""
    camera: str | None = None
    """URL of the camera; None: there is none."""
    pid: int | None = None
    """Of this process, for whoever ends it."""
    points: str | None = None
    """Table of the sensors' bench measurements, for `calibrate --points`."""
