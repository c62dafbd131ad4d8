"""Settings that contradict the data, named before any physics: units, order of caps and cables, signs, rate, gain."""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.finding import Mismatch
from schemas.robot import Robot


def mismatches(runs: Sequence[Run], robot: Robot, speed: float) -> tuple[list[Mismatch], list[str]]:
    """What is plainly set wrong, most basic first, and what could not be looked at."""
    del runs, robot, speed
    return [], []
