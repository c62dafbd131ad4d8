"""The example of two iterations: its world is another one than robot.toml, and its table says what comparisons say."""

from __future__ import annotations

import importlib.util
import json
import math
import shutil
import subprocess
import sys
import tomllib
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.store.toml import load_model
from schemas.robot import Robot
from tests.guards.listing import ROOT

FOLDER = ROOT / "examples" / "13_two_iterations"


def loaded(name: str) -> ModuleType:
    """A module of the example."""
    spec = importlib.util.spec_from_file_location(f"two_iterations_{name}", FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("seed", [0, 1])
def test_the_world_is_another_one(tmp_path: Path, seed: int) -> None:
    """What it draws is what the rig's robot has, within what the README says, and both files can be read."""
    world = loaded("world")
    (tmp_path / "robot.toml").write_text(robot_toml("threebar"))
    drawn = world.unknown(tmp_path, seed)
    told, true = (load_model(tmp_path / name, Robot) for name in ("robot.toml", "truth.toml"))
    assert load_model(tmp_path / "world.toml", World).seed == seed
    assert true.contact.friction == pytest.approx(drawn["friction"], abs=1e-4)
    assert world.FRICTION[0] <= true.contact.friction <= world.FRICTION[1] < told.contact.friction
    for one, other in zip(told.motors, true.motors, strict=True):
        assert other.no_load_rad_per_s / one.no_load_rad_per_s == pytest.approx(drawn["speed"], abs=1e-4)
    for k in range(6, 9):
        stiffness, rest = drawn[f"tendon {k}"]
        assert true.cables[k].stiffness_n_per_m == pytest.approx(100.0 * stiffness, abs=1e-3)
        assert true.cables[k].rest_length_m == pytest.approx(0.165 * rest, abs=1e-5)
    assert true.cables[:6] == told.cables[:6]


def test_worlds_are_drawn_until_one_is_far_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first world in which policies end so many floors apart in the median, and no cable gets shorter than the
    guard allows, is the one that the rig gets; where none is, it ends. What is asked is the engine, of both files."""
    far, world = loaded("far"), loaded("world")
    (tmp_path / "robot.toml").write_text(robot_toml("threebar"))
    asked: list[Path] = []
    enough = far.FLOORS * far.FLOOR_M

    def simulated(folder: Path, robot: Path, project: Path, policies: list[str]) -> list[dict[str, Any]]:
        """One of four policies is off by little, one by more; all by more from world to world."""
        asked.append(robot)
        off = 0.0 if robot.name == "robot.toml" else (len(asked) - 1) * enough / 2.99
        return [{"com_displacement_m": [x, 0.0, 0.1]} for x in (0.1 * off, off, off, 3.0 * off)]

    monkeypatch.setattr(far, "prior_plan", lambda project: project / "40-plan.h5")
    short = iter([0.04, 0.06])
    monkeypatch.setattr(far, "simulated", simulated)
    monkeypatch.setattr(far, "shortest", lambda folder: next(short))
    drawn = far.far_apart(tmp_path, 5)
    assert drawn["world"] == 3 and [path.name for path in asked] == ["robot.toml", *["truth.toml"] * 4]
    assert list(drawn["ends apart, mm"].values())[1] == pytest.approx(4e3 * enough / 2.99)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "robot.toml").write_text(robot_toml("threebar"))
    world.unknown(tmp_path / "other", 5, 3)
    assert (tmp_path / "other" / "truth.toml").read_text() == (tmp_path / "truth.toml").read_text()
    monkeypatch.setattr(far, "simulated", lambda *_: [{"com_displacement_m": [0.0, 0.0, 0.1]}] * 4)
    monkeypatch.setattr(far, "TRIES", 5)
    with pytest.raises(SystemExit, match="none of"):
        far.far_apart(tmp_path, 5)


def test_a_world_whose_robot_is_stopped_is_drawn_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 5 of a run: the next world of the seed, from the beginning; any other ends the example."""
    run = loaded("run")
    asked: list[int] = []

    def prepared(out: Path, seed: int, profile: Any, drawn: Any) -> Path:
        asked.append(drawn.keywords["first"])
        (out / "seed-4").mkdir()
        (out / "seed-4" / "drawn.json").write_text(json.dumps({"world": asked[-1] + 1}))
        return out / "seed-4"

    def iterate(project: Path, number: int, *_: Any) -> None:
        if codes and (code := codes.pop(0)):
            raise subprocess.CalledProcessError(code, ["r2s2r", "run"])

    monkeypatch.setattr(run, "prepared", prepared)
    monkeypatch.setattr(run, "iterate", iterate)
    monkeypatch.setattr(run, "rig", lambda project: nullcontext(("--port", "p")))
    codes, said = [5, 0, 5], []
    assert run.went_through(tmp_path, 4, run.Profile(), said.append) == tmp_path / "seed-4"
    assert asked == [0, 2, 4] and len(said) == 2 and "world 1" in said[0]
    shutil.rmtree(tmp_path / "seed-4")
    codes = [4]
    with pytest.raises(subprocess.CalledProcessError):
        run.went_through(tmp_path, 4, run.Profile(), said.append)
    shutil.rmtree(tmp_path / "seed-4")
    run.went_through(tmp_path, 4, run.Profile(worlds={4: 9}), said.append)
    assert asked[-1] == 9  # those before are known to be none


def report(refined: float, gap: float, floor: float | None = 0.01) -> dict[str, Any]:
    """A comparison of ends under two simulators."""
    ends = {"initial": (0.2, 0.15), "iteration 2": (refined, gap)}
    return {
        "history": [
            {"iteration": 1, "model": name, "runs": {"com_end_m": {"rms": rms, "floor": floor, "gap": floor and left}}}
            for name, (rms, left) in ends.items()
        ]
    }


def test_the_table_says_by_what_the_gap_fell() -> None:
    """Factor, fall to the floor, nothing without a floor; median and range over seeds."""
    table = loaded("table")
    rows = [row for k, gap in enumerate((0.03, 0.05, 0.0)) for row in table.rows_of(report(0.04, gap), str(k))]
    ends = [row for row in rows if row.measure == "com_end_m" and row.error]
    assert [row.falls("iteration 2") for row in ends] == [pytest.approx(5.0), pytest.approx(3.0), math.inf]
    assert ends[0].falls("initial") == 1.0
    lines = list(table.summary(rows))
    assert "iteration 2 5.0 (3.0 .. to the floor)" in lines[1]
    assert "200.00 (200.00 .. 200.00)" in lines[1]
    (blind,) = [r for r in table.rows_of(report(0.04, 0.0, None), "0") if r.measure == "com_end_m" and r.error]
    assert blind.falls("iteration 2") is None


def test_prior_and_truth_are_apart_by_so_many_floors() -> None:
    """A line a policy and the median over all; without a floor no number of floors is told."""
    shown = loaded("shown")
    floors = {"com_end_m": 6.0, "heading_end_rad": None, "segment_s": 2.0}
    found = [
        shown.Apart("seed-0", 1, "straight", 0.06, math.radians(4.0), 0.2, floors),
        shown.Apart("seed-0", 2, "arching", 0.03, 0.1, 0.3, {**floors, "com_end_m": 4.0}),
    ]
    _, first, _, whole = shown.lines(found)
    assert "60.0 mm (6.0)" in first and "4.0 deg (-)" in first and "0.20 s a segment (2.0)" in first
    assert "median 45 mm, 5.0 floors (4.0 .. 6.0)" in whole
    blind = [shown.Apart("seed-0", 1, "straight", 0.06, 0.1, 0.2, dict.fromkeys(floors))]
    assert len(list(shown.lines(blind))) == 2


def test_the_limit_has_the_true_numbers_and_the_calibrated_sensors(tmp_path: Path) -> None:
    """Of what was drawn nothing is left to learn, of robot.toml nothing else is changed, and the loop's own files stay
    as they are; its simulators are told beside the true numbers, median over seeds."""
    limit, world = loaded("limit"), loaded("world")
    project = tmp_path / "seed-3"
    (project / "iterations" / "002").mkdir(parents=True)
    for name in ("30-identify.h5", "51-estimate.h5"):
        (project / "iterations" / "002" / name).write_bytes(b"")
    (project / "robot.toml").write_text(robot_toml("threebar").replace("tolerance = 0.12", "tolerance = 0.09"))
    (project / "project.toml").write_text("[identify]\nfree = []\n")
    world.unknown(project, 3)
    before = (project / "robot.toml").read_text()
    copy = limit.with_the_truth(project)
    assert (project / "robot.toml").read_text() == before
    assert [path.name for path in (copy / "iterations" / "002").iterdir()] == ["51-estimate.h5"]
    found, true, told = (load_model(at, Robot) for at in
                         (copy / "robot.toml", project / "truth.toml", project / "robot.toml"))  # fmt: skip
    assert found.contact.friction == true.contact.friction != told.contact.friction
    assert found.motors == true.motors and found.cables == true.cables
    assert found.pid == told.pid and found.pid.tolerance == 0.09
    free = tomllib.loads((copy / "project.toml").read_text())["identify"]["free"]
    assert [one.partition("=")[0] for one in free] == ["command_delay", "soft_ground.creep_m_per_ns"]
    lines = list(
        limit.lines(
            [report(0.04, 0.0), report(0.06, 0.0)],
            [{"history": [{"iteration": 1, "model": limit.TRUE, "runs": {"com_end_m": {"rms": 0.05}}}]}],
        )
    )
    assert "iteration 2            40.00   60.00   median 50.00" in lines[2]
    assert "true numbers           50.00   median 50.00" in lines[3]


def test_nothing_learns_from_the_new_policies() -> None:
    """Iteration 2 executes none of those that it learned from; repeats make a floor, of which the demo has the fewest
    that can, and the published table one that holds where one of them begins elsewhere."""
    run = loaded("run")
    for profile, fewest in ((run.Profile(), 3), (run.DEMO, 2)):
        first, second = profile.policies
        assert first and second and not set(first) & set(second) and profile.repeats >= fewest
    assert run.DEMO.draw and not run.Profile().draw
    assert run.SHORT["identify"]["max_iterations"] < run.PAPER_STEPS
