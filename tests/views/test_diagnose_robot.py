"""Pictures of a diagnosis accuse what the verdict names and nobody else, and name what was fitted."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.diagnose import draw_diagnosis
from r2s2r_cli.views.diagnose_floor import ARROW, NO_ARROW, floor_picture
from r2s2r_cli.views.diagnose_robot import CAP, MARKED, PLAIN, ROD, named, robot_picture, together
from r2s2r_cli.views.diagnose_words import GUIDE, drawn_effects, verdict_words
from schemas.diagnosis import VERDICTS
from schemas.results_diagnose import DiagnoseReport, ElementFound, RankedName, WhereFound
from tests.guards.listing import ROOT
from tests.support.diagnosed import report

MOTOR = ElementFound(kind="motor", index=1)
FIRST = (RankedName(effect="none", elpd_gain=0.0, probability=0.6), *report().ranking[:1])


def said(verdict: str, element: ElementFound | None, channel: str | None = "motor", **update: object) -> DiagnoseReport:
    """A diagnosis of that verdict, whose cause would sit there."""
    where = WhereFound(segments=(), onset_segment=None, channel=channel, element=element)
    return report().model_copy(update={"verdict": verdict, "where": where, **update})


def robot() -> ArtifactData:
    """Two rods whose first caps lie on each other from the side, as do both winched cables."""
    p = np.array([[0.0, -0.1, 0.0], [0.2, 0.0, 0.2], [0.0, 0.1, 0.0], [0.25, 0.0, 0.1]])
    group = Group({"p_WE": p, "cable": np.array([[0, 1], [2, 1]]), "actuated": np.array([True, True])})
    return ArtifactData("diagnosis", {"robot": group})


@pytest.mark.parametrize(
    ("verdict", "element", "channel", "words"),
    [
        ("effect", ElementFound(kind="rod", index=1), "mass", "named: rod 1"),
        ("effect", ElementFound(kind="camera"), "observation", "named: the camera, nothing on the robot"),
        ("ambiguous", ElementFound(kind="cap", index=3), "contact",
         "undecided, no part is accused; most suspect so far: cap 3 (verdict: ambiguous)"),
        ("effect", None, "motor", "no single part: it acts in channel motor"),
        ("ambiguous", None, "cable",
         "undecided, no part is accused; most suspect so far: channel cable (verdict: ambiguous)"),
        ("unknown", MOTOR, "motor",
         "no part is accused: something is wrong that no effect explains (verdict: unknown)"),
        ("no_gap", MOTOR, None, "no part is accused: there is no gap above the floor (verdict: no_gap)"),
    ],
)  # fmt: skip
def test_the_robot_is_blamed_as_surely_as_the_verdict(
    verdict: str, element: ElementFound | None, channel: str | None, words: str
) -> None:
    """A part is named only where the verdict commits to it; without one, what is known is said."""
    assert named(said(verdict, element, channel)) == words


@pytest.mark.parametrize("channel", ["motor", None])
def test_nothing_is_suspect_where_nothing_wrong_is_likeliest(channel: str | None) -> None:
    """Neither a part nor a channel."""
    words = "undecided, no part is accused (verdict: ambiguous)"
    assert named(said("ambiguous", MOTOR, channel, ranking=FIRST)) == words


@pytest.mark.parametrize(("verdict", "lines"), [("effect", 2), ("ambiguous", 0), ("no_gap", 0), ("unknown", 0)])
def test_only_a_verdict_colours_a_part(figures: list[Figure], verdict: str, lines: int) -> None:
    """The motor's cable in both panels, or nothing: rods and caps are grey; the title is no accusation either."""
    robot_picture(robot(), said(verdict, MOTOR))
    drawn = [line for axes in figures[0].axes for line in axes.lines if to_hex(line.get_color()) == MARKED]
    assert len(drawn) == lines
    title = next(text for text in figures[0].texts if "verdict" in text.get_text() or "named" in text.get_text())
    assert (to_hex(title.get_color()) == MARKED) == bool(lines)
    colours = {to_hex(line.get_color()) for axes in figures[0].axes for line in axes.lines}
    assert colours - {MARKED} == {PLAIN, ROD, CAP}


def test_parts_that_lie_on_each_other_have_one_label(figures: list[Figure]) -> None:
    """From the side: both cables and both caps; from above each has its own."""
    robot_picture(robot(), said("effect", MOTOR))
    above, side = (sorted(text.get_text() for text in axes.texts) for axes in figures[0].axes)
    assert above == ["0", "0", "1", "1", "2", "3"] and side == ["0, 1", "0, 2", "1", "3"]
    shared = next(text for text in figures[0].axes[1].texts if text.get_text() == "0, 1")
    assert to_hex(str(shared.get_color())) != MARKED  # one of the two alone is accused
    assert together(np.array([[0.0, 0.0], [1.0, 0.0], [0.01, 0.0]]), 0.05) == [(0, 2), (1,)]


@pytest.mark.parametrize("verdict", ["effect", "ambiguous"])
def test_a_place_on_the_floor_is_marked_where_it_is_named(figures: list[Figure], verdict: str) -> None:
    """And rods are told by their colours in a legend."""
    rows = Group({"xy": np.zeros((1, 4, 2)), "error": np.full((1, 4, 3), 0.01)})
    place = ElementFound(kind="place", xy_m=(0.1, 0.2))
    floor_picture(ArtifactData("diagnosis", {"segments": rows}), said(verdict, place))
    texts = [text.get_text() for text in figures[0].axes[0].texts]
    assert ("named place" in texts) == (verdict == "effect")
    assert [text.get_text() for text in figures[0].legends[0].texts] == ["rod 0, caps 0 and 1", "rod 1, caps 2 and 3"]


def test_the_curve_is_of_an_effect_that_was_fitted(figures: list[Figure]) -> None:
    """The first of the ranking may be one that no replay shows: what is drawn is the first that was fitted."""
    lost = RankedName(effect="dropout", elpd_gain=0.0, probability=0.3, fitted=False, parity_nats=12.0)
    other = report().ranking[0].model_copy(update={"effect": "motor_speed_mismatch", "probability": 0.1})
    made = said("ambiguous", None, effects=(), ranking=(lost, other, FIRST[0]))
    segments = Group({
        "run": np.array([b"a", b"a"]), "interval": np.array([1, 2]), "gap": np.zeros(2, dtype=bool),
        "t": np.array([[0.0, 1.0], [1.0, 2.0]]), "refit": np.full(2, 0.01), "effect": np.full(2, 0.009),
    })  # fmt: skip
    next(draw_diagnosis(ArtifactData("diagnosis", {"segments": segments}), made))
    assert "refit + motor_speed_mismatch" in [text.get_text() for text in figures[0].legends[0].texts]
    assert drawn_effects(said("pair", None, effects=("motor_speed_mismatch", "payload"),
                              ranking=(*report().ranking, other))) == ("motor_speed_mismatch", "payload")  # fmt: skip
    assert drawn_effects(said("effect", None, effects=("dropout",), ranking=(lost, other))) == ("motor_speed_mismatch",)
    assert drawn_effects(said("no_gap", None, effects=(), ranking=FIRST[:1])) == ()


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_verdict_says_where_to_read_on(verdict: str) -> None:
    """The word, in the guide's table, and a chapter that the guide has."""
    words = verdict_words(said(verdict, None))
    guide = (ROOT / GUIDE).read_text()
    chapter = words.split("chapter ")[1].rstrip(")")
    assert words.startswith(f"{verdict}: ") and f"\n## {chapter}\n" in guide and f"\n| `{verdict}` |" in guide


def test_a_motor_is_on_its_own_cable(figures: list[Figure]) -> None:
    """Motors are numbered through winched cables alone: the second motor need not be on cable 1."""
    group = robot().groups["robot"]
    ends = np.array([[0, 2], [0, 1], [2, 1]])
    passive_first = Group({**group.datasets, "cable": ends, "actuated": np.array([False, True, True])})
    robot_picture(ArtifactData("diagnosis", {"robot": passive_first}), said("effect", MOTOR))
    (marked,) = (line for line in figures[0].axes[0].lines if to_hex(str(line.get_color())) == MARKED)
    wanted = group["p_WE"][ends[2], :2] - group["p_WE"][:, :2].mean(axis=0)
    assert np.allclose(marked.get_xydata(), wanted)


def test_no_arrow_leaves_the_picture_of_the_floor(figures: list[Figure]) -> None:
    """One that ends outside of the axes is not drawn, and those are the largest errors."""
    error = np.zeros((2, 4, 3))
    error[0, 1] = (0.1, -0.2, 0.0)
    rows = Group({"xy": np.full((2, 4, 2), 0.1), "error": error})
    floor_picture(ArtifactData("diagnosis", {"segments": rows}), said("ambiguous", None))
    axes = figures[0].axes[0]
    figures[0].canvas.draw()
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    assert left < 0.1 - ARROW * 0.1 < right and low < 0.1 + ARROW * 0.2 < high
    assert NO_ARROW not in axes.get_title()


def test_intervals_without_arrows_are_explained(figures: list[Figure]) -> None:
    """No error is known where a cap was lost; a dot without an arrow would say that there is none."""
    error = np.full((2, 4, 3), 0.01)
    error[1] = np.nan
    rows = Group({"xy": np.zeros((2, 4, 2)), "error": error})
    floor_picture(ArtifactData("diagnosis", {"segments": rows}), said("ambiguous", None))
    assert figures[0].axes[0].get_title().endswith(NO_ARROW)
