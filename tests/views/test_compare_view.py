"""A comparison as tables, sentence, pictures and page."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.compare import draw_comparison
from r2s2r_cli.views.compare_history import draw_history, history_table
from r2s2r_cli.views.compare_page import comparison_page
from r2s2r_cli.views.compare_playback import playback_data
from r2s2r_cli.views.compare_strip import COLUMNS, draw_strips, picked
from r2s2r_cli.views.compare_tables import IN_PART, TRAINED, comparison_tables, table_one, table_two
from r2s2r_cli.views.compare_verdict import verdict
from schemas.results_compare import (
    CompareEnd,
    CompareFloor,
    CompareHistory,
    CompareMeasure,
    CompareModel,
    ComparePolicy,
    CompareRepeatability,
    CompareReport,
    CompareRun,
)
from tests.support import builders

SCRIPTS = Path(__file__).resolve().parents[2] / "r2s2r_cli" / "views" / "templates"
NODE = shutil.which("node")
HARNESS = Path(__file__).with_name("compare_harness.js")
FLOOR = CompareFloor(com_end_m=0.004, heading_end_rad=None, segment_s=None, keyframe_cap_m=None)


def measure(rms: float, change: float | None = None, spread: float | None = None) -> CompareMeasure:
    """Of four runs; spread: half of the interval of the change."""
    return CompareMeasure(
        rms=rms, lower=0.5 * rms, upper=2 * rms, floor=0.004, gap=max(0.0, rms - 0.004), change=change,
        change_lower=None if change is None or spread is None else change - spread,
        change_upper=None if change is None or spread is None else change + spread, runs=4,
    )  # fmt: skip


def report(refined: float = 0.03, spread: float = 0.01, *, held: bool = True) -> CompareReport:
    """Two simulators on runs of two iterations: initial ends 80 mm off, the refined one as asked for."""
    first = {"com_end_m": measure(0.08)}
    last = {"com_end_m": measure(refined, refined - 0.08, spread)}
    models = tuple(
        CompareModel(model=name, words="", runs=side, heldout=side if held else {}, srcc_com=None, srcc_turn=None,
                     gaits=1) for name, side in (("initial", first), ("refined", last))
    )  # fmt: skip
    history = tuple(
        CompareHistory(iteration=number, model=name, trained_on=name == "refined" and number == 1, runs=side)
        for number in (1, 2) for name, side in (("initial", first), ("refined", last))
    )  # fmt: skip
    policies = tuple(
        ComparePolicy(
            policy=policy, iteration=number, model=name, runs=2, trained_on=name == "refined" and number == 1,
            com_m=(-0.97, 0.4), turn_rad=0.31, com_error_m=None if not name else 0.16,
            turn_error_rad=None if not name else 0.09,
        )
        for number, policy in ((2, "arching"), (1, "001-straight"), (1, "001-turn"))
        for name in ("", "initial", "refined")
    )  # fmt: skip
    repeats = CompareRepeatability(
        policy="arching", runs=("arching-1", "arching-2"), com_mean_m=(-1.14, 0.29), com_sd_m=(0.02, 0.05),
        turn_mean_rad=0.136, turn_sd_rad=0.07, duration_mean_s=12.0, duration_sd_s=0.5,
    )  # fmt: skip
    return CompareReport(
        iteration=2, runs=(), models=models, policies=policies, history=history, repeatability=(repeats,), floor=FLOOR
    )


def test_the_verdict_says_what_got_better_and_that_the_runs_prove_it() -> None:
    """In the words of a person: how far off, beside the floor, on runs that nobody learned from."""
    said = verdict(report())
    assert "4 runs of iteration 2, from which no simulator learned" in said
    assert (
        "30 mm from the real one with refined, 80 mm with initial; a perfect simulator would be found up to 4 mm away"
        in said
    )
    sure = "Of 1 measure refined is better than initial in 1, in 1 beyond its 95 % interval"
    assert f"{sure}, which of so few runs holds less often." in said
    assert "WORSE" not in said


@pytest.mark.parametrize(("spread", "doubt"), [(0.01, False), (0.03, True)])
def test_a_refined_simulator_that_is_worse_is_called_worse(spread: float, doubt: bool) -> None:
    """And where the runs do not prove it that is said as well."""
    said = verdict(report(0.1, spread))
    assert "It is WORSE than initial in: centre of mass at the end (100 against 80 mm" in said
    assert ("do not prove" in said) is doubt


@pytest.mark.parametrize(("now", "says"), [(0.1, "0 of 1 measure; worse: centre of mass at the end 100 against 30 mm"),
                                           (0.02, "1 of 1 measure.")])  # fmt: skip
def test_the_last_simulator_is_held_to_the_one_before_as_well(now: float, says: str) -> None:
    """Of three the verdict says whether the step from the second to the third was one forward."""
    made = report()
    refined = made.models[-1]
    assert refined.heldout
    own = {name: one.model_copy(update={"rms": now}) for name, one in refined.heldout.items()}
    third = refined.model_copy(update={"model": "with effect", "heldout": own})
    said = verdict(made.model_copy(update={"models": (*made.models, third)}))
    assert f"Beside refined it is better in {says}" in said
    assert "Beside" not in verdict(made)


def test_runs_that_were_all_learned_from_back_no_claim() -> None:
    """It is said in the first sentence."""
    assert "ALL trained on: no claim of accuracy rests on them" in verdict(report(held=False))


def test_the_tables_of_the_paper() -> None:
    """Its layout: a column a policy, real and simulated ends, then errors; what was learned from is marked."""
    said = report()
    one, two = table_one(said.repeatability), table_two(said, 1)
    assert one.columns == ["metric", "arching"]
    assert one.rows[0] == ["end CoM position (m)", "[-1.140 ± 0.020, 0.290 ± 0.050]"]
    assert one.rows[1] == ["end orientation (degree)", "7.8 ± 4.0"]
    assert list(two.columns) == ["metric", "CoM [m], straight", "CoM [m], turn", "all runs [m]", "turn [deg], straight",
                                 "turn [deg], turn", "all runs [deg]"]  # fmt: skip
    assert [row[0] for row in two.rows] == ["real robot", "initial simulation", "refined simulation", "initial error",
                                            "refined error", "floor"]  # fmt: skip
    assert two.rows[0][1] == "[-0.970, 0.400]"
    assert two.rows[3][1:4] == ["0.160", "0.160", "0.080 (0.040 to 0.160)"]
    assert two.rows[4][1] == f"0.160 {TRAINED}"
    assert two.rows[5][3] == "0.004"
    assert two.rows[0][4] == "17.8" and two.rows[3][4] == "5.2"  # 0.31 and 0.09 rad
    assert all(len(row) == len(two.columns) for row in two.rows)


def test_runs_that_are_compared_in_part_are_marked() -> None:
    """In the sentence, in the paper's table and in that of every run; nothing is said where all is compared."""
    whole = report()
    policies = [one.model_copy(update={"in_part": int(one.policy == "001-turn")}) for one in whole.policies]
    values = dict.fromkeys(CompareRun.model_fields)
    cut, seen = (
        CompareRun.model_validate({
            **values, "run": f"arching-{number}", "policy": "arching", "iteration": 2, "model": "refined",
            "trained_on": False, "intervals": intervals, "of_intervals": 13, "floor": FLOOR,
            "real_end": CompareEnd(com_m=(0.0, 0.0), turn_rad=None),
        }) for number, intervals in ((1, 6), (2, 13))
    )  # fmt: skip
    part = whole.model_copy(update={"policies": tuple(policies), "runs": (cut, seen)})
    assert "4 runs of iteration 2 (19 of 26 target intervals: 1 run in part), from which" in verdict(part)
    two = table_two(part, 1)
    assert list(two.columns)[1:3] == ["CoM [m], straight", f"CoM [m], turn {IN_PART}"] and IN_PART in two.title
    *_, every = comparison_tables(part)
    assert [row[3] for row in every.rows] == ["6 of 13", "13"]
    assert "in part" not in verdict(whole) and IN_PART not in table_two(whole, 1).title


def test_runs_of_earlier_iterations_have_a_table_of_their_own() -> None:
    """The paper's measure, marked where the simulator learned from them."""
    titles = [table.title for table in comparison_tables(report())]
    assert titles[0].startswith("runs of iteration 2, no simulator was trained on them")
    assert titles[1].startswith("runs of iteration 1 (")
    assert list(next(t for t in comparison_tables(report()) if t.title == titles[1]).columns)[2:] == [
        "initial", f"refined {TRAINED}",
    ]  # fmt: skip


def test_the_history_is_told_and_drawn_where_there_are_two_simulators() -> None:
    """Runs of each iteration under each simulator; other numbers give another picture."""
    table = history_table(report())
    assert table is not None
    assert table.title.startswith("errors over the iterations, the floor below them")  # a gap has its floor taken off
    assert list(table.columns) == ["simulator", "centre of mass at the end [mm], runs of 1",
                                   "centre of mass at the end [mm], runs of 2"]  # fmt: skip
    assert table.rows == [["initial", "80", "80"], ["refined", f"30 {TRAINED}", "30"], ["floor", "4", "4"]]
    first, again, other = draw_history(report()), draw_history(report()), draw_history(report(0.05))
    assert first is not None and first.startswith(b"\x89PNG")
    assert first == again != other
    alone = report().model_copy(update={"history": report().history[::2]})
    assert history_table(alone) is None and draw_history(alone) is None


def test_frames_are_drawn_of_every_run() -> None:
    """A simulator that could not be run leaves its row empty; the last interval is always among those shown."""
    ((run, png),) = draw_strips(builders.comparison(), builders.robot())
    assert run == "walk" and png.startswith(b"\x89PNG")
    assert picked(1) == [0] and picked(3) == [0, 1, 2]
    assert picked(25)[0] == 0 and picked(25)[-1] == 24 and len(picked(25)) == COLUMNS


def test_a_name_is_no_formula(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two `$` matplotlib would read one; what it cannot read would lose the whole comparison."""
    name = r"cost $\\frac$ b $x$ a$"
    read: list[str] = []
    monkeypatch.setattr("matplotlib.mathtext.MathTextParser.parse", lambda parser, text, *more: read.append(text))
    plain, said = builders.comparison(), report()
    names = {**plain.groups["models"].datasets, "name": np.array([b"initial", name.encode()])}
    data = ArtifactData("comparison", {**plain.groups, "models": Group(names)})
    history = tuple(one.model_copy(update={"model": one.model.replace("refined", name)}) for one in said.history)
    draws = (
        lambda: list(draw_comparison(data)), lambda: list(draw_strips(data, builders.robot())),
        lambda: draw_history(said.model_copy(update={"history": history})),
    )  # fmt: skip
    for draw in draws:
        assert draw() and read == []


def test_the_page_needs_nothing_else() -> None:
    """No address, no file beside it, names escaped, one script element for the data that nothing in it can end."""
    plain = builders.comparison()
    names = {**plain.groups["models"].datasets, "name": np.array([b"</script>", b"iteration 1"])}
    data = ArtifactData("comparison", {**plain.groups, "models": Group(names)})
    said = report().model_copy(update={"warnings": ("a <b> warning",)})
    page = comparison_page(said, data, builders.robot(), {"walk": b"png"}, {"walk": b"png"}, b"png").decode()
    assert not re.search(r"https?://|<link|@import|fetch\(|XMLHttpRequest|import\(", page)
    assert page.count("</script>") == 2
    assert "a &lt;b&gt; warning" in page and verdict(said) in page
    assert page.count("data:image/png;base64,") == 3


@pytest.mark.skipif(NODE is None, reason="there is no node to run the player's script with")
def test_the_player_shows_real_and_simulated_where_they_were(tmp_path: Path) -> None:
    """In step, the simulated robot is where the artifact says at each share of an interval, and a hidden one is not
    drawn; by its own clock the slower one lags."""
    data = builders.comparison()
    shown: dict[str, Any] = playback_data(data, builders.robot())
    (tmp_path / "data.json").write_text(json.dumps(shown))
    files = [
        tmp_path / "data.json",
        SCRIPTS / "playback_scene.js",
        SCRIPTS / "playback_page.js",
        SCRIPTS / "compare.js",
    ]
    assert NODE is not None
    done = subprocess.run([NODE, HARNESS, *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    real, simulated = data.groups["runs/walk/real"], data.groups["runs/walk/simulated"]
    assert len(shown["runs"][0]["actors"]) == 2  # the second simulator could not be run
    step = np.array(found["poses"]["step"])
    assert step[-1, 0] == pytest.approx(real["p_WE"][-1, -1], abs=1e-5)
    assert step[-1, 1] == pytest.approx(simulated["p_WE"][0, -1, -1], abs=1e-5)
    assert step[:, 1] - step[:, 0] == pytest.approx(np.broadcast_to([1e-3, 0, 0], step[:, 1].shape), abs=2e-5)
    own = np.array(found["poses"]["own"])
    assert np.linalg.norm(own[1, 1] - own[1, 0] - [1e-3, 0, 0], axis=-1).min() > 1e-4
    assert float(re.match(r"[\d.]+", found["clocks"][-1])[0]) == pytest.approx(2.5)  # type: ignore[index]
    assert found["clocks"][-1].endswith("initial 1 mm")
    assert 0 < found["fewer"] < found["all"] and found["drawn"]["timeline"] > 50
