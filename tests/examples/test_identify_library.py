"""The example of identification as a library does what its guide says."""

from __future__ import annotations

import re
import textwrap

import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.request import Request
from schemas.results_identify import IdentifyReport
from schemas.robot import Robot
from tests.examples.load import load
from tests.guards.listing import ROOT

robot_log = load("09_identify_library", "robot_log")
example = load("09_identify_library", "run")


def test_the_guide_shows_the_example() -> None:
    """Every Python block of the page stands in run.py, word for word but for its indentation."""
    page = (ROOT / "docs/guides/identify-library.md").read_text()
    code = (ROOT / "examples/09_identify_library/run.py").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) == 7
    for block in blocks:
        indented = (textwrap.indent(block.rstrip("\n"), " " * depth) for depth in (0, 4, 8))
        assert any(f"\n{one}\n" in code for one in indented), block


@pytest.fixture(scope="module")
def made() -> tuple[Robot, list[RunData], Request, ArtifactData, IdentifyReport]:
    """The example's runs, request and fit."""
    robot, runs = example.played()
    request = example.asked(runs)
    return robot, runs, request, *example.fitted(robot, runs, request)


@pytest.mark.slow
def test_what_was_planted_comes_back(made: tuple[Robot, list[RunData], Request, ArtifactData, IdentifyReport]) -> None:
    """Both numbers within 3 sd or 3 %; restitution, which a slow gait does not show, has no interval."""
    robot, _, _, data, report = made
    for name, truth in robot_log.TRUTH.items():
        one = report.parameters[name]
        assert one.identifiable and one.sd is not None
        assert abs(one.value - truth) < max(3 * one.sd, 0.03 * truth), name
    assert (report.parameters["restitution"].lower, report.parameters["restitution"].range) == (None, None)
    assert example.learnt(robot, report).motors[0].speed == pytest.approx(report.parameters["motor_speed"].value)
    assert data.kind == "identification"


@pytest.mark.slow
def test_what_it_prints(
    made: tuple[Robot, list[RunData], Request, ArtifactData, IdentifyReport], capsys: pytest.CaptureFixture[str]
) -> None:
    """What the runs could tell before the fit, the rivals, and every number with its worth."""
    robot, runs, request, _, report = made
    example.told_before(robot, runs, request)
    example.judged(report.heldout)
    example.trusted(report)
    said = capsys.readouterr().out
    assert "before the fit restitution  not identifiable" in said
    assert re.search(r"nothing moves +\d+\.\d mm, surely worse", said)
    assert re.search(r"found +motor_speed +0\.[78]\d\d, 0\.\d+ \.\. 0\.\d+, identified", said)
