"""`record`: policies on the robot, every raw sample, command and picture into a journal.

`plans` says what is recorded, `run_layout` what the journal of a run will hold, `Session.record` does it. The link and
the camera come from outside (`devices`), open; rows go to a sink from one thread of their own.
"""

from __future__ import annotations

from r2s2r_cli.stages.record.layout import CameraFacts, StreamLayout, place_of, run_layout
from r2s2r_cli.stages.record.plan import RunPlan, as_run, plans, run_attributes
from r2s2r_cli.stages.record.policies import EXCITATIONS, excitation, random_targets
from r2s2r_cli.stages.record.run import Now
from r2s2r_cli.stages.record.session import Session

__all__ = [
    "EXCITATIONS", "CameraFacts", "Now", "RunPlan", "Session", "StreamLayout", "as_run", "excitation", "place_of",
    "plans", "random_targets", "run_attributes", "run_layout",
]  # fmt: skip
