"""The verdict in one sentence: each verdict says what it is of, and nothing that contradicts it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.words import ADVICE, sentence
from schemas.results_diagnose import NO_REPLAY


def found(verdict: str, **changes: object) -> SimpleNamespace:
    """A diagnosis with a payload on rod 1 as its best effect, and 12 mm that become 6 at a floor of 5."""
    best = SimpleNamespace(effect="payload", element=changes.pop("element", Element("rod", 1)), probability=0.4)
    much = SimpleNamespace(
        effects=("payload",), names=("b:1", "b:2"), floor=0.005, within_run=False, set_aside=(), share=0.7,
        ci90=(-0.004, 0.9), predicted=0.65, rmse={"refit": 0.012, "effect": 0.006}.get,
    )  # fmt: skip
    values = {"verdict": verdict, "effects": ("payload",), "probability": 0.9, "set90": ("payload", "none", "unknown"),
              "best": best, "stranger": None, "confusable": (), "ranking": (SimpleNamespace(effect="none"), best),
              "no_gap": SimpleNamespace(rmse=0.012, upper=0.014, floor=0.005, kept=1.0)}  # fmt: skip
    if changes.pop("first", False):
        values["ranking"] = (best, SimpleNamespace(effect="none"))
    where = SimpleNamespace(onset=changes.pop("onset", None))
    return SimpleNamespace(
        which=SimpleNamespace(**{**values, **changes}), much=much, channel="mass", where=where,
    )  # fmt: skip


SHRUNK = "key-frame error from 12.0 to 6.0 mm (floor 5.0), which closes 70 % (0 .. 90) of the gap above the floor"


@pytest.mark.parametrize(
    ("diagnosis", "begins", "holds"),
    [
        (found("effect"), "The gap is caused by payload at rod 1 (p = 0.90). On 2 held-out intervals payload", SHRUNK),
        (found("effect", element=Element("world")), "The gap is caused by payload (p = 0.90).", SHRUNK),
        (found("pair", effects=("payload", "backlash")), "The gap has two causes, payload and backlash", SHRUNK),
        (found("ambiguous"),
         "These runs do not decide between payload, nothing wrong and something unnamed (best p = 0.90).",
         "the likeliest effect, payload, takes"),
        (found("ambiguous", set90=("payload",)), "These runs do not decide: payload is the likeliest (p = 0.90).",
         "the likeliest effect, payload, takes"),
        (found("unknown"), "Something is wrong that none of the effects looked for explains (p = 0.90): 12.0 mm",
         "It acts most like something in channel mass."),
        (found("no_gap", no_gap=SimpleNamespace(rmse=0.005, upper=0.006, floor=0.005, kept=0.75)),
         "There is no gap above the floor: 5.0 mm after refitting on the best 75 % of the intervals, upper 90 % bound",
         "bound 6.0 mm; floor 5.0 mm."),
        (found("no_gap", no_gap=SimpleNamespace(rmse=0.005, upper=0.006, floor=0.005, kept=1.0), first=True),
         "There is no gap above the floor: 5.0 mm", "floor 5.0 mm. Below it may hide payload (p = 0.40)."),
    ],
)  # fmt: skip
def test_each_verdict_has_its_sentence(diagnosis: SimpleNamespace, begins: str, holds: str) -> None:
    """What is committed to is a cause; what is not is the best of several; what is everywhere has no place."""
    said = sentence(diagnosis)  # type: ignore[arg-type]
    assert said.startswith(begins)
    assert holds in said


def test_what_the_logs_show_is_said_in_place_of_a_channel() -> None:
    """Of something that no effect explains."""
    strange = SimpleNamespace(what="off against the camera are sensor 0 by +22 mm and others")
    said = sentence(found("unknown", stranger=strange))  # type: ignore[arg-type]
    assert "The logs show it: off against the camera are sensor 0 by +22 mm" in said and "acts most like" not in said


def test_of_many_names_the_likeliest_are_said() -> None:
    """And how many there are."""
    names = ("payload", "none", "unknown", "backlash", "motor_lag")
    ranking = [SimpleNamespace(effect=name, probability=0.5 - 0.1 * k) for k, name in enumerate(names)]
    said = sentence(found("ambiguous", set90=names, ranking=ranking))  # type: ignore[arg-type]
    wanted = "5 names remain, the likeliest payload (0.50), nothing wrong (0.40), something unnamed (0.30)."
    assert said.startswith(f"These runs do not decide: {wanted} On 2 held-out")


def test_at_the_floor_there_is_no_share() -> None:
    """A refit error at the floor has nothing to close, and a run on both sides of the split is said."""
    one = found("effect")
    one.much.share, one.much.within_run = None, True
    said = sentence(one)  # type: ignore[arg-type]
    assert "of the same run payload takes" in said
    assert said.endswith("the refit error is at the floor, so there is no share to speak of.")


@pytest.mark.parametrize(
    ("nominal", "ends"), [(0.011, "none of the gap; as identified it is 11.0 mm."), (0.02, "closes none of the gap.")]
)
def test_what_shrinks_nothing_is_not_praised(nominal: float, ends: str) -> None:
    """A first name that makes held-out intervals no better is no best one, and what was identified before may be."""
    one = found("ambiguous")
    one.much.share, one.much.rmse = -0.1, {"nominal": nominal, "refit": 0.012, "effect": 0.0125}.get
    said = sentence(one)  # type: ignore[arg-type]
    assert "the likeliest effect, payload, takes the key-frame error from 12.0 to 12.5 mm" in said
    assert said.endswith(ends)


def test_a_name_that_is_not_shown_to_help_comes_with_a_warning() -> None:
    """Where the interval of its share holds 0, and where these runs cannot tell it from another effect."""
    names = {"payload": 0.9, "backlash": 0.05, "motor_lag": 0.05, "soft_ground": 0.01}
    one = found(
        "effect", ranking=[SimpleNamespace(effect=name, probability=p) for name, p in names.items()],
        confusable=(("backlash", "payload", 1.7), ("payload", "motor_lag", 4.0), ("payload", "soft_ground", 0.0)),
    )  # fmt: skip
    said = sentence(one)  # type: ignore[arg-type]
    assert "(p = 0.90). These runs cannot tell it from backlash. On" in said
    assert said.endswith("that it helps is not shown, so do not act on it yet.")
    one.much.ci90 = (0.2, 0.9)
    assert sentence(one).endswith("; predicted to close 65 %.")  # type: ignore[arg-type]


def test_when_it_began_is_said() -> None:
    """Of what was not there from the first interval on."""
    late = SimpleNamespace(order=7, run="g2", interval=2)
    assert "payload at rod 1, from interval 2 of g2 on (p = 0.90)." in sentence(found("effect", onset=late))  # type: ignore[arg-type]
    first = SimpleNamespace(order=0, run="g1", interval=1)
    assert "payload at rod 1 (p = 0.90)." in sentence(found("effect", onset=first))  # type: ignore[arg-type]


def test_every_effect_that_no_replay_tells_has_advice() -> None:
    """There are no intervals to say how much it shrinks."""
    assert set(ADVICE) == set(NO_REPLAY)
    knocked = found("effect", effects=("camera_pose",), element=Element("camera"))
    knocked.which.best.effect, knocked.much = "camera_pose", None
    said = sentence(knocked)  # type: ignore[arg-type]
    assert said.startswith("The gap is caused by camera_pose (p = 0.90). That changes what is seen")
    assert said.endswith("set the camera up anew, and leave out what was recorded since.")


def test_what_was_measured_is_not_called_likelier_than_what_no_fit_tells() -> None:
    """An effect that only the logs show may be first, and no interval can be measured with it."""
    one = found("ambiguous", best=SimpleNamespace(effect="dropout", element=None, probability=0.4))
    assert "the likeliest of the effects that were fitted, payload, takes" in sentence(one)  # type: ignore[arg-type]


def test_a_gap_that_would_grow_is_no_share() -> None:
    """A prediction below nothing closes nothing, by however much."""
    one = found("ambiguous")
    one.much.predicted = -10.2
    assert "of the gap above the floor; predicted to close none;" in sentence(one)  # type: ignore[arg-type]
