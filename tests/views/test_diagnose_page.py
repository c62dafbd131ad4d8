"""The page of a diagnosis: the sentence, the share with its prediction, what is not calibrated, no network."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.diagnose import draw_diagnosis
from r2s2r_cli.views.diagnose_page import ROBOT, diagnose_page, diagnose_tables, use
from schemas.results_diagnose import DiagnoseReport, NextGaitFound, PairFound
from tests.support.diagnosed import report


def test_the_page_says_what_was_found_and_what_it_is_worth() -> None:
    """The sentence, the warning, that probabilities are by hand; nothing is loaded from elsewhere."""
    page = diagnose_page(report(), []).decode()
    assert "payload at rod 1" in page and "look here" in page
    assert "<h1>Diagnosis of threebar: effect</h1>" in page and "Verdict effect: one effect of the catalogue" in page
    assert "uncalibrated" in page
    assert "http://" not in page and "https://" not in page


def test_tables_hold_the_share_beside_its_prediction_and_its_doubts() -> None:
    """Both shares, the size with its unit and interval, the bound it ended on, and who cannot be told apart."""
    text = "\n".join(" | ".join(row) for table in diagnose_tables(report()) for row in table.rows)
    assert "70 % (40 .. 90)" in text and "65 %" in text
    assert "mass 0.0400 (0.0300 .. 0.0500) kg" in text
    assert "place on a bound" in text
    assert "payload | com_offset | 2.1 | cannot be told apart" in text


def test_rivals_and_numbers_say_what_they_are() -> None:
    """Why `none` has a probability without a gain; a gain has its sd, a factor is a share, a number has its unit."""
    first = report().ranking[0].model_copy(update={"elpd_gain_sd": 4.0})
    units = {"friction": "log", "motor_lag.tau_s": "s"}
    made = report().model_copy(update={
        "ranking": (first, report().ranking[1]), "refit": {"friction": (0.1, 0.02), "motor_lag.tau_s": (0.03, 0.004)},
        "refit_units": units,
    })  # fmt: skip
    text = "\n".join(" | ".join(row) for table in diagnose_tables(made) for row in table.rows)
    assert (
        "31.0 +- 4.0" in text and "none |  | 0.0 |  |  | 0.10" in text and "weighs the same in every diagnosis" in text
    )
    assert "refit: friction | +10.5 % +- 2.2 % of the identified value" in text
    assert "refit: motor_lag.tau | +0.0300 s +- 0.0040 s" in text


def test_what_was_not_fitted_has_no_gain() -> None:
    """Its 0 was never measured; of several numbers the intervals say whose they are, with units."""
    first, second = report().ranking[0], report().ranking[1]
    size, units = (
        {"payload.mass_kg.1": 0.04, "payload.place_m.1": 0.1},
        {"payload.mass_kg.1": "kg", "payload.place_m.1": "m"},
    )
    ci90 = {"payload.mass_kg.1": (0.03, 0.05), "payload.place_m.1": (0.05, 0.15)}
    ranking = (
        first.model_copy(update={"size": size, "units": units, "ci90": ci90, "marginal_nats": 52.0}),
        second.model_copy(update={"effect": "dropout", "fitted": False, "marginal_nats": 0.0}),
    )
    table = next(iter(diagnose_tables(report().model_copy(update={"ranking": ranking}))))
    rows = {row[0]: row for row in table.rows}
    assert rows["dropout"][3] == "-" and "not fitted" in rows["dropout"][-1]
    assert rows["payload"][3].startswith("31.0") and rows["payload"][2] == "52.0" and rows["dropout"][2] == ""
    assert rows["payload"][6] == "mass 0.0400 (0.0300 .. 0.0500) kg; place 100 (50.0 .. 150) mm"


def test_a_terminal_is_told_what_something_is_said_of() -> None:
    """Effects that were not fitted, are not in the 90 % set and that no log speaks for stand in one row, as do the
    refitted numbers; the page has all of them."""
    first, none = report().ranking
    others = tuple(
        none.model_copy(update={"effect": name, "fitted": False, "probability": p, "parity_nats": nats,
                                 "seen_sd": None if name == "dropout" else 3.0})
        for name, p, nats in (("com_offset", 0.02, 0.0), ("backlash", 0.03, 0.2), ("dropout", 0.01, 9.0),
                              ("motor_lag", 0.01, 0.0))
    )  # fmt: skip
    made = report().model_copy(update={"ranking": (first, none, *others)})
    brief, whole = (list(diagnose_tables(made, brief=short)) for short in (True, False))
    names = [row[0] for row in brief[0].rows]
    assert names == ["payload", "none", "com_offset", "dropout", "2 others"] and brief[0].rows[-1][5] == "<= 0.03 each"
    assert [row[0] for row in whole[0].rows] == ["payload", "none", "com_offset", "backlash", "dropout", "motor_lag"]
    assert not any(row[0] == "refit: friction" for row in brief[-1].rows)
    assert any(row[0] == "refit: friction" for row in whole[-1].rows)


def test_two_effects_at_once_say_what_the_second_one_adds() -> None:
    """Over the first alone, on what was left out and on all data; without pairs there is no such table."""
    first = report().ranking[0].model_copy(update={"marginal_nats": 52.0})
    pair = PairFound(effects=("payload", "backlash"), elpd_gain=44.5, marginal_nats=80.0)
    made = report().model_copy(update={"ranking": (first, *report().ranking[1:]), "pairs": (pair,)})
    rows = [row for table in diagnose_tables(made) for row in table.rows if row[0] == "payload + backlash"]
    assert rows == [["payload + backlash", "44.5", "+13.5", "+28.0"]]
    older = made.model_copy(update={"ranking": report().ranking})
    assert ["payload + backlash", "44.5", "+13.5", ""] in [r for t in diagnose_tables(older) for r in t.rows]
    assert len(list(diagnose_tables(made))) == len(list(diagnose_tables(report()))) + 1


def test_what_was_named_comes_with_the_command_that_uses_it() -> None:
    """At the element and sizes that were found; what has no number, and what is not committed to, has none."""
    plain = "--with-effect payload:1 --free +payload.mass_kg.1=0.04"
    assert use(report()) == f"r2s2r identify {plain}"
    placed = report().model_copy(update={"iteration": 1, "free_iteration": 3})
    assert use(placed) == f"r2s2r identify --iteration 3 --also 1 {plain}"
    place = {"friction_field.patch_factor": 0.262, "friction_field.patch_x_m": 0.2034}
    row = report().ranking[0].model_copy(update={"effect": "friction_field", "size": place})
    floor = report().model_copy(update={"effects": ("friction_field",), "ranking": (row,)})
    assert use(floor).endswith("--with-effect friction_field --free +friction_field.patch_factor=0.262 "
                               "--free +friction_field.patch_x_m=0.2034")  # fmt: skip
    assert not use(report().model_copy(update={"verdict": "ambiguous", "effects": ()}))
    lost = report().ranking[0].model_copy(update={"effect": "dropout", "size": {}})
    assert not use(report().model_copy(update={"effects": ("dropout",), "ranking": (lost,)}))


@pytest.mark.parametrize(
    ("nats", "now", "words"),
    [
        (
            30.0,
            2.0,
            "ramps: likeliest to decide between the likeliest candidates, worth 30.0 nats, these runs again 2.0",
        ),
        (2.0, 3.0, "nothing separates the candidates better than these runs; the best of the library is ramps"),
        (2.0, None, "ramps: likeliest to decide between the likeliest candidates, worth 2.0 nats (little)"),
    ],
)
def test_what_to_run_next_is_said_beside_what_was_run(nats: float, now: float | None, words: str) -> None:
    """With the command; a gait that is worth less than the runs so far is not praised."""
    file = "iterations/001/70-diagnose-next.toml"
    one = NextGaitFound(name="ramps", file=file, targets=((1.0,),), nats=nats, now=now)
    made = report().model_copy(update={"next_gait": one, "free_iteration": 2})
    rows = [row for table in diagnose_tables(made) for row in table.rows if row[0] == "run next"]
    command = f"r2s2r record {file} --iteration 2 --repeats 2 {ROBOT}"
    assert rows == [["run next", f"{words}: {command}"]]


def test_what_would_be_told_apart_is_named_nothing_wrong_among_it() -> None:
    """The refit nominal model is a candidate too, in words."""
    one = NextGaitFound(name="ramps", file=None, targets=((1.0,),), nats=9.0, now=None,
                        candidates=("none", "payload", "com_offset"))  # fmt: skip
    rows = [row for table in diagnose_tables(report().model_copy(update={"next_gait": one})) for row in table.rows]
    assert [
        "run next",
        "ramps: likeliest to decide between nothing wrong, payload and com_offset, worth 9.0 nats",
    ] in rows


def test_more_runs_are_asked_for_where_the_bound_of_no_gap_is_what_is_open() -> None:
    """Nothing wrong is the likeliest, and no gait tells it from effects: any run narrows the bound."""
    nothing = report().ranking[0].model_copy(update={"effect": "none", "size": {}})
    made = report().model_copy(update={"verdict": "ambiguous", "effects": (), "ranking": (nothing,)})
    (advice,) = [row[1] for table in diagnose_tables(made) for row in table.rows if row[0] == "run next"]
    assert advice.endswith("; more runs of any gait narrow the bound that `no_gap` is judged by")


def test_no_error_lies_outside_of_its_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Panels share an axis of errors: the largest of the last run is seen as well, and 0 is its lower end."""
    figures: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("r2s2r_cli.views.diagnose.png_bytes", kept)
    refit = np.array([0.002, 0.003, 0.1, 0.004])
    segments = Group({
        "run": np.array([b"a", b"a", b"b", b"b"]), "interval": np.array([1, 2, 1, 2]), "gap": refit > 0.05,
        "t": np.array([[0.0, 1.0], [1.0, 2.0], [0.0, 1.0], [1.0, 2.0]]), "refit": refit, "effect": refit / 2,
    })  # fmt: skip
    name, _, _ = next(draw_diagnosis(ArtifactData("diagnosis", {"segments": segments}), report()))
    assert name == "gap"
    for axes in figures[0].axes:
        low, high = axes.get_ylim()
        assert low == 0.0 and high > 100.0


def test_a_gap_that_is_to_grow_is_no_share() -> None:
    """What was predicted of it is none, not a percentage below nothing."""
    made = report()
    assert made.shrinkage is not None
    made = made.model_copy(update={"shrinkage": made.shrinkage.model_copy(update={"predicted": -10.2})})
    (row,) = (row for table in diagnose_tables(made) for row in table.rows if row[0].startswith("predicted"))
    assert row[-1] == "none"


def test_where_no_gait_helps_healthy_runs_would() -> None:
    """With the commands; not where there are some, nor where a cause is named."""
    lacking = {"missing": ("healthy runs: findings are against robot.toml",), "iteration": 1, "free_iteration": 2}
    undecided = report().model_copy(update={"verdict": "ambiguous", **lacking})

    def advice(made: DiagnoseReport) -> str:
        return next(row[1] for table in diagnose_tables(made) for row in table.rows if row[0] == "run next")

    assert f"r2s2r record --random 15 --repeats 2 --iteration 2 {ROBOT}" in advice(undecided)
    assert "r2s2r diagnose --iteration 1 --also 2 --healthy RUN" in advice(undecided)
    plain = "no gait of the library is likely to decide more"
    assert advice(undecided.model_copy(update={"missing": ()})) == plain == advice(report().model_copy(update=lacking))
