"""Sessions of `record` on a robot of straight lines that ran to their end."""

from __future__ import annotations

from r2s2r_cli.stages.record import Session, plans
from schemas.config import RecordSettings
from schemas.policy import PolicyFile
from schemas.robot import Robot
from tests.support.fake_robot import FakeLink, Rows


def policy(robot: Robot, *targets: float, name: str = "gait", **step: float) -> PolicyFile:
    """All cables to each of the targets in turn."""
    steps = [{"target": (target,) * len(robot.actuated), **step} for target in targets]
    return PolicyFile.model_validate({"schema_version": 1, "robot": robot.name, "name": name, "steps": steps})


def recorded(link: FakeLink, *policies: PolicyFile, repeats: int = 1, rest: float = 0.5) -> tuple[Session, Rows]:
    """A session that ran to its end, and its rows."""
    session, rows = Session(plans(policies, repeats=repeats, rest=rest), link.robot, link, RecordSettings()), Rows()
    session.record(rows)
    return session, rows
