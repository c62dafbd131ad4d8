"""The ranking of a diagnosis: why something was not fitted, sizes that mean something, the floor beside every error."""

from __future__ import annotations

import re

import pytest

from r2s2r_cli.effects import CATALOGUE, FURTHER
from r2s2r_cli.views.diagnose_gains import drawn_rows, ranking_picture
from r2s2r_cli.views.diagnose_page import diagnose_tables
from r2s2r_cli.views.diagnose_ranking import ranking_table
from schemas.people import plain_name, quantity, rounded
from schemas.results_diagnose import DiagnoseReport, RankedName
from tests.support.diagnosed import report


def ranked(*names: RankedName) -> DiagnoseReport:
    """A diagnosis with this ranking, that commits to nothing."""
    return report().model_copy(update={"verdict": "ambiguous", "effects": (), "set90": ("none",), "ranking": names})


NONE = RankedName(effect="none", elpd_gain=0.0, probability=0.6, rmse_m=0.0132)
UNKNOWN = RankedName(effect="unknown", elpd_gain=24.8, probability=0.1)
DROPOUT = RankedName(effect="dropout", elpd_gain=0.0, probability=0.06, fitted=False, parity_nats=12.1)
POSE = RankedName(effect="camera_pose", elpd_gain=0.0, probability=0.01, fitted=False, parity_nats=0.3)
PLAY = RankedName(effect="backlash", elpd_gain=0.0, probability=0.01, fitted=False, seen_sd=12.0)
SLOW = RankedName(
    effect="com_offset", elpd_gain=1.0, marginal_nats=-0.4, probability=0.01, size={"com_offset.axial_m.1": 0.00966},
    ci90={"com_offset.axial_m.1": (0.00826, 0.0111)}, units={"com_offset.axial_m.1": "m"}, seen_sd=8.0, rmse_m=0.0134,
)  # fmt: skip


def test_what_no_replay_shows_was_not_fitted_for_that_reason() -> None:
    """It promised nothing because nothing of it is simulated; others promised too little, and both say which."""
    rows = {row[0]: row for row in ranking_table(ranked(NONE, DROPOUT, PLAY)).rows}
    assert rows["dropout"][-1] == "not fitted: it changes nothing that is simulated, so the logs alone speak"
    assert rows["backlash"][-1] == "not fitted: it promised too little"
    brief = ranking_table(ranked(NONE, DROPOUT, POSE, PLAY), brief=True).rows
    assert brief[-1][0] == "2 others"
    assert "too little, or change nothing that is simulated (camera_pose)" in brief[-1][-1]
    lag = PLAY.model_copy(update={"effect": "motor_lag"})
    assert ranking_table(ranked(NONE, PLAY, lag), brief=True).rows[-1][-1] == (
        "not fitted: they promised too little; all with --json"
    )


def test_a_single_other_and_what_was_asked_for_have_rows_of_their_own() -> None:
    """`1 others` takes as much room as the name does; an effect of `--effect` is what somebody wants to know of."""
    assert [row[0] for row in ranking_table(ranked(NONE, PLAY), brief=True).rows] == ["none", "backlash"]
    assert [one.effect for one in drawn_rows(ranked(NONE, PLAY))] == ["backlash", "none"]
    made, asked = ranked(NONE, POSE, PLAY), ("camera_pose", "backlash")
    assert [row[0] for row in ranking_table(made, brief=True).rows] == ["none", "2 others"]
    assert [row[0] for row in ranking_table(made, brief=True, asked=asked).rows] == ["none", *asked]
    assert [one.effect for one in drawn_rows(made, asked)] == [*asked, "none"]
    assert next(iter(diagnose_tables(made, brief=True, asked=asked))).rows[1][0] == "camera_pose"


def test_a_fit_that_never_left_its_start_has_no_size() -> None:
    """Neither a number nor an interval; one that moved has both, in the units that people read, the unit once."""
    still = SLOW.model_copy(update={"moved": False})
    rows = [ranking_table(ranked(NONE, one)).rows[1] for one in (SLOW, still)]
    assert rows[0][6] == "axial 9.66 (8.26 .. 11.1) mm"
    assert rows[1][6] == "" and rows[1][-1] == "never left its start, so no size"


def test_every_error_stands_beside_its_floor() -> None:
    """In the column's name, and the title says what it was taken from; that of `none`, where it is of the best
    intervals alone, has that floor in its cell."""
    table = ranking_table(ranked(NONE, SLOW))
    assert table.title == "what explains the gap, beside a floor of 5.0 mm (repeats)"
    assert table.columns[7] == "left-out error [mm], floor 5.0" and table.rows[0][7] == "13.2"
    part = ranked(NONE, SLOW).model_copy(update={"refit_kept": 0.75, "refit_floor_m": 0.004})
    assert [row[7] for row in ranking_table(part).rows] == ["13.2 (best 75 % of intervals, floor 4.0)", "13.4"]


def test_sizes_stand_in_one_order() -> None:
    """As they are shown when they are made and when they are read from the file, whose names are sorted."""
    size = {"tether_drag.force_n.2": 0.157, "tether_drag.anchor_x_m.2": -0.746}
    ends = {name: (value - 0.1, value + 0.1) for name, value in size.items()}
    units = {"tether_drag.force_n.2": "N", "tether_drag.anchor_x_m.2": "m"}
    made = SLOW.model_copy(update={"effect": "tether_drag", "size": size, "ci90": ends, "units": units})
    read = made.model_copy(update={"size": dict(sorted(size.items()))})
    first, again = (ranking_table(ranked(NONE, one)).rows[1][6] for one in (made, read))
    assert first == again == "anchor_x -746 (-846 .. -646) mm; force 0.157 (0.0570 .. 0.257) N"


def test_what_is_known_is_drawn() -> None:
    """What was fitted or the logs speak for, then the two that are no effects, `unknown` with its gain; the rest is in
    the table."""
    made = ranked(NONE, UNKNOWN, DROPOUT, POSE, PLAY, SLOW)
    assert [one.effect for one in drawn_rows(made)] == ["dropout", "com_offset", "none", "unknown"]
    assert ranking_picture(made).startswith(b"\x89PNG")


def test_bars_are_what_the_logs_say_and_what_unknown_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that only the logs speak for has a bar as long as they say."""
    lengths: list[float] = []

    def kept(figure: object) -> bytes:
        lengths.extend(float(bar.get_width()) for bar in figure.axes[0].patches)  # type: ignore[attr-defined]
        return b""

    monkeypatch.setattr("r2s2r_cli.views.diagnose_gains.png_bytes", kept)
    ranking_picture(ranked(NONE, UNKNOWN, DROPOUT, SLOW))
    assert {12.1, 24.8, -0.4} <= set(lengths)


def test_the_two_errors_have_two_names_and_none_is_explained() -> None:
    """Of fitted intervals left out, and of held-out ones; why `none` may be likelier than what gains more."""
    tables = list(diagnose_tables(report()))
    text = "\n".join(" | ".join(row) for table in tables for row in table.rows)
    shrinks = next(table for table in tables if table.title.startswith("how far"))
    assert shrinks.title == "how far the gap shrinks, 2 held-out intervals"
    assert (
        shrinks.columns[1].startswith("held-out error") and ["floor of held-out intervals", "5.0", ""] in shrinks.rows
    )
    assert "left-out error of the refit | 12.0 mm" in text
    assert "floor | 5.0 mm: repeats; that of identify is another: repeats among its own segments" in text
    assert "two errors | left-out error: of fitted intervals" in text
    assert "none and unknown | a gain is what these runs say, before what is known beforehand" in text


def test_one_interval_is_not_many_and_no_effect_has_no_row() -> None:
    """`1 held-out interval`; where no effect was simulated there is no row of `refit + `."""
    known = report().shrinkage
    assert known is not None
    alone = known.model_copy(update={"judged_on": ("b:1",), "effects": ()})
    tables = diagnose_tables(report().model_copy(update={"shrinkage": alone}))
    table = next(one for one in tables if one.title.startswith("how far"))
    assert table.title == "how far the gap shrinks, 1 held-out interval"
    assert [row[0] for row in table.rows][1:3] == ["refit", "refit + a black box"]


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [(0.00966, "m", "9.66 mm"), (-1.56e-5, "m/s", "-0.0156 mm/s"), (0.01, "rad", "0.573 deg"), (1.08, "1", "1.08"),
     (-2.348, "m", "-2348 mm"), (0.0, "m", "0 mm"), (0.157, "N", "0.157 N"), (0.3, "1/N", "0.300 1/N")],
)  # fmt: skip
def test_people_read_millimetres_and_degrees(value: float, unit: str, words: str) -> None:
    """Three digits, no powers of ten, the unit once."""
    assert quantity(value, unit) == words


def test_a_name_loses_the_unit_that_stands_behind_its_number() -> None:
    """And nothing else; so does every number of an effect whose name says a unit of several."""
    numbers = [own for effect in (*CATALOGUE, *FURTHER) for own in effect.own if " " in own.unit or "/" in own.unit]
    shown = {plain_name(own.name, own.unit) for own in numbers}
    assert not [name for name in shown if re.search("_(n|m|s)_|_per_(m|n|s)", name)]
    assert {"drag", "speed", "creep"} <= shown
    assert plain_name("compliance_m_per_n", "m/N") == "compliance" and plain_name("factor", "1") == "factor"
    assert plain_name("per_newton", "1/N") == "per_newton" and rounded(0.0371, 2) == "0.037"


def test_what_rounds_to_nothing_has_no_sign() -> None:
    """Of a gain of -0.04 nats nobody knows which way it goes."""
    first = report().ranking[0].model_copy(update={"elpd_gain": -0.04, "marginal_nats": -0.03})
    none = report().ranking[1].model_copy(update={"elpd_gain": -0.01})
    table = ranking_table(report().model_copy(update={"ranking": (first, none)}))
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [row["all data: gain [nats]"] for row in rows] == ["0.0", "0.0"]
    assert rows[0]["left out: gain +- sd [nats]"] == "0.0"


def test_the_unit_of_evidence_is_explained() -> None:
    """Every table of gains is in nats, which a newcomer does not know."""
    rows = {row[0]: row[1] for table in diagnose_tables(report()) for row in table.rows if len(row) == 2}
    assert "1 nat makes the runs e = 2.7 times as likely" in rows["nats"]
