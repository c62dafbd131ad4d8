"""What the tests of the host's side of the wire share."""

from __future__ import annotations

import pytest

from schemas.robot import Robot
from tests.support.wire_robot import calibrated


@pytest.fixture(scope="session")
def threebar() -> Robot:
    """The robot of the paper with calibrated sensors."""
    return calibrated("threebar")
