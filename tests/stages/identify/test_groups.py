"""What was found is what the artifact and the report say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.checks import CHECKS
from r2s2r_cli.checks.base import run_checks
from r2s2r_cli.checks.subjects import Content
from r2s2r_cli.stages.identify.columns import texts
from r2s2r_cli.stages.identify.found import OURS, REPEATS, ParameterFound
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.repeating import LeftOut, Repeating, Repeats, WithRepeats
from r2s2r_cli.stages.identify.report import report_of
from r2s2r_cli.stages.measures.floor import Floor
from r2s2r_cli.stages.measures.table import Predicted, judge
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.write import write_artifact
from schemas.results_identify import IdentifyReport
from tests.stages.identify.planted import BOUNCE, found
from tests.support.builders import provenance
from tests.support.layouts import same

BARE: dict[str, Any] = {
    "test_segments": (), "test": None, "free_runs": (), "closed_loop_m": None, "covariance": None, "information": None,
    "trace": (), "starts": (), "profiles": (), "windows": (), "updates": (),
}  # fmt: skip


@pytest.mark.parametrize("changes", [{}, BARE], ids=["whole", "bare"])
def test_the_artifact_fits_its_layout_and_is_sound(tmp_path: Path, changes: dict[str, Any]) -> None:
    """It is written and read back as it is, and no check of `validate` complains but the run's honest ones."""
    data = identification(found(**changes))
    write_artifact(tmp_path / "30-identify.h5", data, provenance())
    assert same(read_artifact(tmp_path / "30-identify.h5", "identification")[1], data)
    assert run_checks(CHECKS, Content(data), "a.h5") == []


def test_what_was_not_made_is_left_out() -> None:
    """A fit without anything held out has facts, parameters, measures and its training segments."""
    groups = identification(found(**BARE)).groups
    assert list(groups) == ["fit", "parameters", "segments", "measures", "runs/line", "runs/line/fit"]


def test_a_number_that_the_runs_do_not_say_never_has_an_interval() -> None:
    """Even where a solver handed one over: NaN in the artifact, None in the report, and the value is there."""
    data, said = identification(found()).groups["parameters"], report_of(found()).parameters["restitution"]
    assert [bool(np.isnan(data[name][1])) for name in ("sd", "lower", "upper")] == [True] * 3
    assert (said.sd, said.lower, said.upper, said.value, said.identifiable) == (None, None, None, 0.3, False)
    assert (said.trust, said.reason) == ("not identifiable", "no effect")


def test_a_flat_prior_and_an_endless_bound_are_nan() -> None:
    """Infinity is not stored; the layout says what NaN stands for."""
    data = identification(found()).groups["parameters"]
    assert np.isnan(data["prior_sd"]).tolist() == np.isnan(data["prior_mean"]).tolist() == [False, True]
    assert data["bounds"][1].tolist() == [BOUNCE.lower, BOUNCE.upper]
    assert data["coordinate"].tolist() == [1, 2]


def test_errors_of_segments_are_those_of_the_plan() -> None:
    """1 mm in training, 3 and 4 mm in the test at the key frames; over all frames the root of the mean of squares."""
    segments = identification(found()).groups["segments"]
    assert segments["role"].tolist() == [1, 1, 2, 2]
    assert segments["keyframe_cap_rmse"] == pytest.approx([0.001, 0.001, 0.003, 0.004])
    share = np.sqrt(np.mean(np.linspace(0, 1, 5) ** 2))
    assert segments["cap_rmse"] == pytest.approx(share * segments["keyframe_cap_rmse"])
    assert segments["baseline_cap_rmse"][:, 0] == pytest.approx(0.01)
    assert segments["keyframe_error"][2] == pytest.approx(np.tile([0, 0, 0.003], (6, 1)))


def test_measures_of_both_sides() -> None:
    """Root mean square over segments: sqrt((3^2 + 4^2) / 2) mm; no free run was judged, the closed loop was."""
    measures = identification(found()).groups["measures"]
    rows = list(zip(measures["role"].tolist(), measures["metric"].tolist(), strict=True))
    assert rows == [(1, b"keyframe_cap_rmse"), (2, b"keyframe_cap_rmse"), (2, b"free_run_cap_mean"),
                    (2, b"free_run_closed_loop_cap_mean")]  # fmt: skip
    assert measures["value"] == pytest.approx([0.001, np.sqrt(12.5e-6), np.nan, 0.02], nan_ok=True)
    assert measures["baseline"].tolist() == [b"nothing moves"]
    assert measures["baseline_value"][:2, 0] == pytest.approx(0.01)


def test_the_report_says_the_same() -> None:
    """Held-out error, baseline with its difference (ours is always better), segments in order, weak words."""
    said = report_of(found())
    assert said.heldout is not None
    assert said.heldout.keyframe_cap_rmse_m == pytest.approx(np.sqrt(12.5e-6))
    still = said.heldout.baselines["nothing moves"]
    assert still.keyframe_cap_rmse_m == pytest.approx(0.01) and still.ours_better == 1.0
    assert still.difference.keyframe_cap_rmse_m is not None and still.difference.keyframe_cap_rmse_m[1] < 0
    assert said.heldout.free_run_closed_loop_cap_mean_m == 0.02
    assert [(s.interval, s.role, s.not_white) for s in said.segments] == [
        (1, "train", (2,)), (2, "train", (2,)), (3, "test", (2,)), (4, "test", (2,)),
    ]  # fmt: skip
    assert [one.words for one in said.weak] == ["restitution alone"]
    assert [(c.one, c.other, round(c.value, 6)) for c in said.correlations] == [("motor_speed", "restitution", 0.9)]
    assert [one.lower for one in said.profiles] == [0.71, None]
    assert IdentifyReport.model_validate(said.model_dump(mode="json")) == said


def test_nothing_held_out_is_said_so() -> None:
    """No test intervals: no held-out error, instead of one of 0."""
    assert report_of(found(**BARE)).heldout is None


def repeating(used: bool) -> dict[str, Any]:
    """What repeats, planted: 2 mm and 1 mm off at the key frames of the test intervals, which the simulator misses by 3
    and 4; training intervals speak for it, or against."""
    plain, evidence = found(), (0.004, 0.003) if used else (0.003, 0.004)
    up = np.array([0.0, 0.0, 1e-3])
    keys = np.array([one.step.key + off * up for one, off in zip(plain.test_segments, (2, 1), strict=True)])
    free = tuple(one.step.p_WE for one in plain.test_segments)
    model = Repeating((), 16e-6, 2, Floor(0.003, None, 2, 0.001, ()), 5.0, 0.0)
    made = WithRepeats(Predicted(keys, free), np.array([0.5, 0.0]), np.array([2, 0]))
    rows = judge([one.step for one in plain.test_segments], {REPEATS: made.predicted})
    runs = tuple(replace(one, predicted=path) for one, path in zip(plain.free_runs, free, strict=True))
    return {"repeats": Repeats(model, LeftOut(*evidence, 2), made), "test": {**(plain.test or {}), **rows},
            "free_runs": runs}  # fmt: skip


def test_what_repeats_is_the_prediction_where_training_speaks_for_it(tmp_path: Path) -> None:
    """Then its errors come first, under its own name, and the simulator's stand among the baselines; else the other way
    round. What the artifact calls simulated is the simulator's either way."""
    data, said = identification(found(**repeating(True))), report_of(found(**repeating(True)))
    assert said.heldout is not None and said.heldout.predictor == REPEATS
    assert said.heldout.keyframe_cap_rmse_m == pytest.approx(np.sqrt(2.5e-6))
    assert said.heldout.baselines[OURS].keyframe_cap_rmse_m == pytest.approx(np.sqrt(12.5e-6))
    assert [one.predicted_cap_rmse_m for one in said.segments] == pytest.approx([None, None, 0.002, 0.001])
    assert [one.keyframe_cap_rmse_m for one in said.segments] == pytest.approx([0.001, 0.001, 0.003, 0.004])
    assert said.repeating is not None and said.repeating.weights == (0.5, 0.0) and said.repeating.left_out_m == 0.003
    write_artifact(tmp_path / "30-identify.h5", data, provenance())
    assert run_checks(CHECKS, Content(data), "a.h5") == []
    assert data.groups["measures"].attributes["predictor"] == REPEATS
    assert data.groups["measures"]["value"][1] == pytest.approx(np.sqrt(2.5e-6))
    assert data.groups["repeating"]["keyframe_cap_rmse"] == pytest.approx([0.002, 0.001])
    assert data.groups["segments"]["keyframe_cap_rmse"] == pytest.approx([0.001, 0.001, 0.003, 0.004])
    not_used = report_of(found(**repeating(False)))
    assert not_used.heldout is not None and not_used.heldout.predictor == OURS
    assert not_used.heldout.keyframe_cap_rmse_m == pytest.approx(np.sqrt(12.5e-6))
    assert REPEATS in not_used.heldout.baselines and not_used.segments[2].predicted_cap_rmse_m is None


def test_free_runs_of_one_run_are_put_together() -> None:
    """Each chain of test intervals has its own start; the column chain tells them apart."""
    free = identification(found()).groups["runs/line/free_run"]
    assert free["chain"].tolist() == [0] * 5 + [1] * 5
    assert np.all(np.diff(free["t"]) >= 0)
    assert isinstance(free, Group) and "closed_loop" in free


def test_what_was_fixed_by_hand_stands_behind_what_was_free(tmp_path: Path) -> None:
    """A third parameter, fixed: every table has its column, with its value or nothing, and the layout holds."""
    fixed = ParameterFound(replace(BOUNCE, name="friction"), 0.6, *[math.nan] * 3, (math.nan,) * 2, None, "by hand")
    plain = found()
    wide = np.full((3, 3), np.nan)
    wide[:2, :2] = plain.covariance
    data = identification(replace(plain, parameters=(*plain.parameters, fixed), covariance=wide))
    write_artifact(tmp_path / "30-identify.h5", data, provenance())
    assert run_checks(CHECKS, Content(data), "a.h5") == []
    assert data.groups["starts"]["last"][:, 2].tolist() == [0.6, 0.6]
    assert data.groups["parameters"]["trust"].tolist() == [0, 2, 4]
    assert data.groups["identifiability"]["eigenvector"][:, 2].tolist() == [0, 0]
    assert (
        report_of(replace(plain, parameters=(*plain.parameters, fixed), covariance=wide)).parameters["friction"].trust
        == "fixed"
    )


def test_a_page_can_say_that_a_run_is_no_measurement() -> None:
    """What a run is stands beside its data; a run that does not say has no such word, not an empty one."""
    assert identification(found()).groups["runs/line"].attributes["nature"] == "simulated"
    assert "nature" not in identification(found(natures={})).groups["runs/line"].attributes


def test_words_are_stored_as_text() -> None:
    """UTF-8 of fixed length, also of none at all."""
    assert texts(["größer", "a"]).tolist() == ["größer".encode(), b"a"]
    assert texts([]).dtype.kind == "S"
