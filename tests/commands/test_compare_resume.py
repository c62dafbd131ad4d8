"""A comparison that was interrupted keeps the runs that it has simulated, and goes on with the others to the same."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands.status import survey
from r2s2r_cli.commands.wanted import robot_part
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.compare.predicted import predicted
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.simulate.drive import Start
from r2s2r_cli.stages.simulate.policies import Sequence
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.write import write_artifact
from schemas.versions import STAGE_VERSIONS
from tests.commands.conftest import document, invoke
from tests.support import builders
from tests.support.identified import identification

FOLDER = Path("iterations/001")
IDENTIFY, COMPARE, KEPT = (FOLDER / name for name in ("30-identify.h5", "60-compare.h5", "60-compare.partial"))
ESTIMATE = FOLDER / "20-estimate.h5"
COMMAND = ("compare", "--of", "record", "--no-draw")
BOTH = ["robot.toml", str(IDENTIFY)]
"""The simulators, in their order."""


class Engine:
    """Stands for `Driver`: a simulated run that depends on the simulator's numbers, at once. done: by which simulators
    runs were simulated. stop: the one that is interrupted."""

    done: list[str]
    stop: str | None

    def __init__(self, robot: Any, settings: object, cache_dir: object, numbers: Identified) -> None:
        self.robot, self.numbers, self.structure = robot, numbers, None

    def closed_loop(self, name: str, targets: Sequence, start: Start, progress: object) -> Any:
        """A second for every target, the caps anywhere."""
        if self.numbers.words == Engine.stop:
            raise KeyboardInterrupt
        Engine.done.append(self.numbers.words)
        target = np.repeat(targets.target, 10, axis=0)
        drawn = np.random.default_rng(round(1e6 * float(self.numbers.theta.mass.sum() + self.numbers.values.sum())))
        p_WE = start.p_WE + 0.01 * drawn.standard_normal((len(target), *start.p_WE.shape))
        frames = {"t": 0.1 * np.arange(len(target)), "p_WE": p_WE, "length": np.ones((len(target), 9))}
        return SimpleNamespace(frames=frames, control_at=0 * target, target_at=target, timed_out=(2,))


def replayed(data: Any, chosen: Any, predictor: Any, values: np.ndarray, *_: object, **__: object) -> Any:
    """Key frames of an identified simulator that are all a centimetre off; those of the other one are not finite."""
    if not len(values):
        raise NumericalError("the commands left the finite numbers", hint="r2s2r validate")
    key = np.zeros((len(chosen[0].intervals), 6, 3))
    return SimpleNamespace(steps=[SimpleNamespace(key=one) for one in key], predicted=SimpleNamespace(key=key + 0.01))


def fitted(more: float = 0.0) -> None:
    """An identification with the robot that there is now. more: is added to a number."""
    robot = Project.find(Path()).robot()
    made = builders.provenance(
        stage="identify", stage_version=STAGE_VERSIONS["identify"], robot=robot_part("identify", robot), inputs=()
    )
    data = identification(robot)
    data.groups["parameters"]["value"][1] += more
    write_artifact(IDENTIFY, data, made)


@pytest.fixture
def bot(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The estimated sample with an identification, as the working directory; two simulators, none of them slow."""
    fitted()
    Engine.done, Engine.stop = [], None
    stage = sys.modules[predicted.__module__]
    monkeypatch.setattr(stage, "Driver", Engine)
    monkeypatch.setattr(stage, "replayed", replayed)
    return estimated


@pytest.fixture
def whole(bot: Path) -> str:
    """The content hash of a comparison that nobody disturbed; it is gone."""
    found = document(*COMMAND)["content_sha256"]
    assert Engine.done == BOTH and not KEPT.exists()
    COMPARE.unlink()
    return str(found)


@pytest.fixture
def stopped(whole: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """The same after Ctrl-C in the second simulator."""
    with monkeypatch.context() as patch:
        patch.setattr(sys, "argv", ["r2s2r", *COMMAND])
        Engine.done, Engine.stop = [], BOTH[1]
        result = invoke(*COMMAND)
    assert result.exit_code == 130
    assert result.stderr.splitlines()[-2:] == [
        f"interrupted: what was simulated so far is kept in {KEPT}, nothing else was written",
        "hint: r2s2r compare --of record --no-draw --resume",
    ]
    assert Engine.done == BOTH[:1] and not COMPARE.exists()
    Engine.done, Engine.stop = [], None
    return whole


def test_it_goes_on_with_the_runs_that_are_left(bot: Path, stopped: str) -> None:
    """`status` says how. Nothing is simulated twice, and the artifact is that of a comparison in one go."""
    (said,) = [one for one in survey(Project.find(bot)).artifacts if one.artifact == str(KEPT)]
    assert said.state == "interrupted" and "r2s2r compare --of record --no-draw --resume" in said.reasons[0]
    held = KEPT.read_bytes()
    again = document(*COMMAND, "--resume")
    assert again["state"] == "done" and Engine.done == BOTH[1:]
    assert again["content_sha256"] == stopped
    assert not KEPT.exists()
    KEPT.write_bytes(held)  # where a fresh artifact was made anew, and that was interrupted
    why = document(*COMMAND, "--resume", "--dry-run")["reasons"]
    assert why == ["--resume goes on with what was interrupted"]


def test_interrupted_once_more_it_keeps_both_parts(stopped: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the pictures, say: then there is nothing left to simulate."""
    with monkeypatch.context() as patch:
        patch.setattr("r2s2r_cli.stages.compare.report_of", _interrupt)
        assert invoke(*COMMAND, "--resume").exit_code == 130
    assert Engine.done == BOTH[1:]
    assert document(*COMMAND, "--resume")["content_sha256"] == stopped
    assert Engine.done == BOTH[1:]


def test_without_the_option_it_begins_anew(stopped: str) -> None:
    """Nothing old is taken, and nothing of it is left."""
    assert document(*COMMAND)["content_sha256"] == stopped
    assert Engine.done == BOTH and not KEPT.exists()


def faster() -> None:
    """Another robot, of which the same numbers were identified."""
    robot = Path("robot.toml")
    robot.write_text(robot.read_text("utf-8").replace("speed = 0.8\n", "speed = 0.81\n"), "utf-8")
    fitted()


def finer() -> None:
    """A setting of the simulation."""
    project = Path("project.toml")
    project.write_text(project.read_text("utf-8").replace("frame_rate_hz = 50.0", "frame_rate_hz = 25.0"), "utf-8")


def refitted() -> None:
    """Another identification in the place of the one that it was."""
    fitted(0.01)


def seen_otherwise() -> None:
    """Other states of the real run."""
    header, data = read_artifact(ESTIMATE, "estimate")
    data.groups["runs/sample/frames"]["p_WE"][:, 0, 0] += 1e-4
    write_artifact(ESTIMATE, data, header.provenance)


@pytest.mark.parametrize("change", [faster, finer, refitted, seen_otherwise])
def test_of_other_inputs_nothing_is_taken(stopped: str, change: Callable[[], None]) -> None:
    """Robot, settings, simulator, real run: refused with the command that begins anew."""
    change()
    refused = invoke(*COMMAND, "--resume")
    assert refused.exit_code == 2 and "the checkpoint belongs to another request" in refused.stderr
    assert refused.stderr.splitlines()[-1].startswith("hint: r2s2r compare")
    assert Engine.done == [] and KEPT.exists()


def test_another_effect_of_a_package_is_another_simulator(stopped: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its next version may do something else."""
    monkeypatch.setattr("r2s2r_cli.installed.installed_words", lambda: "side_wind (windy 1.1)")
    assert "another request" in invoke(*COMMAND, "--resume").stderr


def test_what_is_no_checkpoint_is_refused(stopped: str) -> None:
    """Damaged at its head it says nothing: exit code 4 and the command that begins anew. Damaged in a result, that one
    is simulated again."""
    held = KEPT.read_bytes()
    KEPT.write_bytes(b"\0" * 20 + held[20:])
    refused = invoke(*COMMAND, "--resume")
    assert refused.exit_code == 4 and "the checkpoint cannot be read" in refused.stderr
    assert refused.stderr.splitlines()[-1] == "hint: r2s2r compare"
    KEPT.write_bytes(held[:-1] + bytes([held[-1] ^ 1]))
    assert document(*COMMAND, "--resume")["content_sha256"] == stopped
    assert Engine.done == BOTH


def test_a_dry_run_finds_out_whether_there_is_a_way_on(stopped: str) -> None:
    """It refuses what the real one would: another request's, a damaged one. What is there stays as it was."""
    held = KEPT.read_bytes()
    dry = (*COMMAND, "--resume", "--dry-run")
    assert document(*dry)["state"] == "dry_run"
    other = invoke("compare", "--of", "record", "--model", str(IDENTIFY), "--resume", "--dry-run")
    assert other.exit_code == 2 and "the checkpoint belongs to another request" in other.stderr
    assert KEPT.read_bytes() == held
    KEPT.write_bytes(b"\0" * 20 + held[20:])
    refused = invoke(*dry)
    assert refused.exit_code == 4 and "the checkpoint cannot be read" in refused.stderr
    assert KEPT.read_bytes() == b"\0" * 20 + held[20:]


def test_where_nothing_was_interrupted_it_says_so(bot: Path) -> None:
    """And compares all the same."""
    assert "nothing was interrupted" in invoke(*COMMAND, "--resume").stderr
    assert COMPARE.exists() and not os.path.lexists(KEPT)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
