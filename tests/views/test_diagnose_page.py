"""The page of a diagnosis: the sentence, the share with its prediction, what is not calibrated, no network."""

from __future__ import annotations

import pytest

from r2s2r_cli.views.diagnose_page import diagnose_page, diagnose_tables
from r2s2r_cli.views.diagnose_words import loud_words
from schemas.results_diagnose import NextGaitFound, PairFound
from tests.support.diagnosed import report


def test_the_page_says_what_was_found_and_what_it_is_worth() -> None:
    """The sentence, the warning, that probabilities are by hand; nothing is loaded from elsewhere."""
    page = diagnose_page(report(), []).decode()
    assert "payload at rod 1" in page and "look here" in page
    assert "<h1>Diagnosis of threebar: effect</h1>" in page and "Verdict effect: one effect of the catalogue" in page
    assert "uncalibrated" in page
    assert "http://" not in page and "https://" not in page


def test_a_page_of_effects_that_were_asked_for_speaks_of_them() -> None:
    """Not of a catalogue that nobody looked at, but for what is known of it: that `unknown` is told by it. With the
    catalogue the same places say so."""
    unknown = report().ranking[1].model_copy(update={"effect": "unknown"})
    made = report().model_copy(update={"ranking": (*report().ranking, unknown)})
    pages = {only: diagnose_page(made, [], only=only).decode() for only in (True, False)}
    asked = ("Verdict effect: one effect of those asked for is the cause", "a cause that is none of those asked for",
             "the best of those asked for gains 4.0 nats")  # fmt: skip
    for words in asked:
        assert words in pages[True] and words not in pages[False]
        assert words.replace("those asked for", "the catalogue") in pages[False]
    assert pages[True].count("catalogue") == 1 and "that share of unknown is too little" in pages[True]
    assert "too little: they" not in pages[False]


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


def test_what_would_be_told_apart_is_named_nothing_wrong_among_it() -> None:
    """The refit nominal model is a candidate too, in words; how likely each is stands beside it."""
    one = NextGaitFound(name="ramps", file=None, targets=((1.0,),), nats=9.0, now=None,
                        candidates=("none", "payload", "com_offset"))  # fmt: skip
    rows = [row for table in diagnose_tables(report().model_copy(update={"next_gait": one})) for row in table.rows]
    assert [
        "run next",
        "ramps: likeliest to decide between nothing wrong (10 %), payload (90 %) and com_offset, worth 9.0 nats",
    ] in rows


def test_a_gait_that_narrows_a_bound_is_not_said_to_tell_candidates_apart() -> None:
    """How many target intervals it adds is what it is worth."""
    one = NextGaitFound(name="ramps", file=None, targets=((1.0,),), nats=0.0, now=None, narrows=7)
    rows = [row for table in diagnose_tables(report().model_copy(update={"next_gait": one})) for row in table.rows]
    assert [
        "run next",
        "ramps: no gait tells candidates apart; 7 target intervals of it narrow the bound that `no_gap` is judged by",
    ] in rows


def test_more_runs_are_asked_for_where_the_bound_of_no_gap_is_what_is_open() -> None:
    """Nothing wrong is the likeliest, and no gait tells it from effects: any run narrows the bound."""
    nothing = report().ranking[0].model_copy(update={"effect": "none", "size": {}})
    made = report().model_copy(update={"verdict": "ambiguous", "effects": (), "ranking": (nothing,)})
    (advice,) = [row[1] for table in diagnose_tables(made) for row in table.rows if row[0] == "run next"]
    assert advice.endswith("; more runs of any gait narrow the bound that `no_gap` is judged by")


def test_a_gap_that_is_to_grow_was_predicted_all_the_same() -> None:
    """Its share is below nothing: a number, which `none` would hide, and what it means."""
    made = report()
    assert made.shrinkage is not None
    made = made.model_copy(update={"shrinkage": made.shrinkage.model_copy(update={"predicted": -0.148})})
    table = next(one for one in diagnose_tables(made) if one.title.startswith("how far"))
    assert table.rows[-1] == ["predicted before it was looked at", "", "-15 % (the gap would grow)"]
    assert table.columns[-1].endswith("(90 % interval)")


@pytest.mark.parametrize(
    ("verdict", "first", "channel", "element"),
    [
        ("effect", "payload", "mass", "rod 1"),
        ("no_gap", "payload", "below the floor; likeliest: mass", "below the floor; likeliest: rod 1"),
        ("ambiguous", "payload", "undecided; most suspect so far: mass", "undecided; most suspect so far: rod 1"),
        ("ambiguous", "none", "undecided; were something wrong, likeliest: mass",
         "undecided; were something wrong, likeliest: rod 1"),
    ],
)  # fmt: skip
def test_where_a_cause_sits_is_said_as_surely_as_the_verdict(
    verdict: str, first: str, channel: str, element: str
) -> None:
    """A part or channel without a verdict is a suspicion; nothing known is undecided, too."""
    ranking = (report().ranking[0].model_copy(update={"effect": first}),)
    made = report().model_copy(update={"verdict": verdict, "ranking": ranking})
    rows = [row for table in diagnose_tables(made) for row in table.rows]
    assert ["channel", channel] in rows and ["element", element] in rows
    begun = made.model_copy(update={"where": made.where.model_copy(update={"onset_segment": 3, "onset": "g2:3"})})
    rows = [row for table in diagnose_tables(begun) for row in table.rows]
    assert ["begins with", element.replace("rod 1", "g2:3")] in rows
    nowhere = made.where.model_copy(update={"channel": None, "element": None})
    rows = [row for table in diagnose_tables(made.model_copy(update={"where": nowhere})) for row in table.rows]
    assert ["element", "undecided" if verdict == "ambiguous" else "-"] in rows


@pytest.mark.parametrize(
    ("verdict", "sd", "said"),
    [("ambiguous", 6.0, True), ("no_gap", -6.0, True), ("ambiguous", 3.8, False), ("effect", 6.0, False)],
)
def test_what_the_logs_shout_is_beneath_a_sentence_that_names_nothing(verdict: str, sd: float, said: bool) -> None:
    """Beyond 4 sd, either way, by the number and not by the words; a verdict with a name speaks for itself."""
    parity = ("sensor 0 reads 13 mm too long, 0 mm as built", "something else (+9.0 sd)")
    made = report().model_copy(update={"verdict": verdict, "parity": parity, "parity_sd": (sd, 2.9)})
    page = diagnose_page(made, []).decode()
    assert ("<p>Yet the logs by themselves" in page) == said
    loud = loud_words(made)
    assert loud == (f"Yet the logs by themselves stand out by more than 4 sd: {parity[0]}." if said else "")


@pytest.mark.parametrize(
    ("gain", "fitted", "sd", "said"),
    [(-1.2, True, 6.0, True), (0.0, True, 6.0, True), (3.0, True, 6.0, False), (0.0, False, 6.0, False),
     (-1.2, True, 3.8, False)],
)  # fmt: skip
def test_what_the_logs_shout_and_the_replay_gains_nothing_by_is_said(
    gain: float, fitted: bool, sd: float, said: bool
) -> None:
    """Only of an effect that was simulated, and whose finding is told: to identify with it would be in vain."""
    none = report().ranking[-1]
    other = none.model_copy(update={"effect": "sensor_bias", "marginal_nats": gain, "fitted": fitted})
    made = report().model_copy(update={
        "verdict": "ambiguous", "ranking": (none, other), "parity": ("sensor 0 reads too long", "rods turn"),
        "parity_sd": (sd, 9.0), "parity_effects": ("sensor_bias", ""),
    })  # fmt: skip
    words = f" Simulating it does not help: the runs are predicted no better with sensor_bias ({gain:+.1f} nats)."
    assert loud_words(made).endswith(words) == said
    assert ("Simulating" in loud_words(made)) == said


def test_what_was_not_measured_is_not_at_the_floor() -> None:
    """Without an effect nothing was foretold; of one that could not be simulated there is no share."""
    made = report()
    assert made.shrinkage is not None
    for changes, rows in (
        ({"effects": (), "refit_plus_effect": None, "own_share": None, "ci90": None, "predicted": None}, 0),
        ({"refit_plus_effect": None, "own_share": None, "ci90": None}, 2),
    ):
        other = made.model_copy(update={"shrinkage": made.shrinkage.model_copy(update=changes)})
        table = next(one for one in diagnose_tables(other) if one.title.startswith("how far"))
        assert not any("at the floor" in cell for row in table.rows for cell in row)
        assert sum(row[0].startswith(("refit + p", "predicted")) for row in table.rows) == rows
