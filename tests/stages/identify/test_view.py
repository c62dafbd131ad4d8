"""The page of an identification: everything is on it, nothing is invented, and it needs no network."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.identify import draw_identification, parameters_figure
from r2s2r_cli.views.identify_data import near_zero
from r2s2r_cli.views.identify_errors import draw_errors, errors_with_repeats, floor_of
from r2s2r_cli.views.identify_fits import cap_rmse
from r2s2r_cli.views.identify_information import draw_information, information_figure
from r2s2r_cli.views.identify_page import identify_page, report_tables, verdict
from r2s2r_cli.views.identify_search import draw_history
from r2s2r_cli.views.identify_self_test import self_test_tables
from schemas.results_identify import Intervals, Recovered, RecoveredCase, SelfTestReport
from tests.stages.identify.reports import report
from tests.support import builders

OPTIONAL = ("covariance", "identifiability", "trace", "starts", "profiles", "windows", "segments", "repeating", "sites",
            "history", "runs/walk/fit", "runs/walk/free_run")  # fmt: skip


@pytest.fixture(scope="module")
def pictures() -> dict[str, tuple[str, bytes]]:
    """Every picture by name, with its title."""
    drawn = draw_identification(builders.identification(repeating=True))
    return {name: (title, png) for name, title, png in drawn}


def without(*groups: str) -> ArtifactData:
    """The identification without some of its groups."""
    data = builders.identification(repeating=True)
    return replace(data, groups={path: group for path, group in data.groups.items() if path not in groups})


def changed(path: str, name: str, value: np.ndarray) -> ArtifactData:
    """The identification with another dataset."""
    data = builders.identification(repeating=True)
    group = data.groups[path]
    return replace(data, groups={**data.groups, path: Group({**group.datasets, name: value}, group.attributes)})


def test_every_part_is_drawn(pictures: dict[str, tuple[str, bytes]]) -> None:
    """One picture for each question, every run among them, each a PNG."""
    assert list(pictures) == ["parameters", "information", "errors", "fit-walk", "free-walk", "search", "history"]
    assert all(png.startswith(b"\x89PNG") and len(png) > 5000 for _, png in pictures.values())


def test_what_repeats_stands_at_its_own_segment() -> None:
    """Training segments have none; without that part there is no line at all."""
    groups = builders.identification(repeating=True).groups
    off = errors_with_repeats(groups["segments"], groups["repeating"])
    assert off is not None
    assert off == pytest.approx([np.nan, 0.5 * groups["segments"]["keyframe_cap_rmse"][1]], nan_ok=True)
    assert errors_with_repeats(groups["segments"], None) is None


def test_no_mark_lies_on_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Baselines that are as wrong as each other stand side by side at their segment."""
    figures: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("r2s2r_cli.views.identify_errors.png_bytes", kept)
    draw_errors(builders.identification())
    marks = [line.get_xdata()[0] for line in figures[0].axes[0].lines if line.get_linestyle() == "None"]  # type: ignore[index]
    assert len(marks) > 2 and len(set(marks)) == len(marks) and max(map(abs, marks)) < 0.5


def test_what_is_not_there_is_not_drawn() -> None:
    """Only parameters and measures are required: the picture of the parameters is always there."""
    assert [name for name, _, _ in draw_identification(without(*OPTIONAL))] == ["parameters"]


def test_a_trace_without_values_and_without_profiles_is_drawn() -> None:
    """Methods that keep no values along the way still show their loss."""
    data = without("profiles", *(path for path in OPTIONAL if path not in ("trace", "profiles")))
    bare = Group({k: v for k, v in data.groups["trace"].datasets.items() if k != "value"})
    drawn = draw_identification(replace(data, groups={**data.groups, "trace": bare}))
    assert [name for name, _, _ in drawn] == ["parameters", "search"]


def test_the_page_is_self_contained_and_complete(pictures: dict[str, tuple[str, bytes]]) -> None:
    """No address and no file beside it; verdict, warnings (escaped), every table and every picture are on it."""
    data = builders.identification(repeating=True)
    said = report(data)
    page = identify_page(said, data, list(pictures.values())).decode()
    assert not re.search(r"https?://|<link|<script|@import", page)
    assert page.count("<img") == page.count('src="data:image/png;base64,') == len(pictures)
    assert "cap 5 of walk is &lt;noisy&gt;" in page
    assert "kinematic sample, not a measurement" in page
    for title in [table.title for table in report_tables(said)] + [title for title, _ in pictures.values()]:
        assert f"<h2>{title}</h2>" in page.replace("&#39;", "'")
    for name in said.parameters:
        assert f"<td>{name}</td>" in page


def test_a_parameter_that_is_not_identifiable_has_no_interval() -> None:
    """A dash instead of a narrow interval, the reason beside it."""
    table = next(iter(report_tables(report(builders.identification(repeating=True)))))
    row = dict(zip(table.columns, next(row for row in table.rows if row[0] == "restitution"), strict=True))
    assert (row["sd"], row["95 % interval"], row["range"]) == ("-", "-", "-")
    assert row["unit"] == "1"  # a blank cell would say that nobody knows it
    assert row["trust"] == "not identifiable" and row["why"] == "zero sensitivity: no cap bounced"
    first = dict(zip(table.columns, table.rows[0], strict=True))
    assert first["95 % interval"] == "0.7804 .. 0.8196"


def test_errors_stand_beside_floor_and_baselines() -> None:
    """Train, held out, every baseline and the floor in one table, in mm; what a baseline cannot say is a dash."""
    said = report(builders.identification(repeating=True))
    table = next(table for table in report_tables(said) if table.title.startswith("errors"))
    assert [row[0] for row in table.rows] == [
        "identified, train", "identified, held out", "nothing moves, held out", "repeat the same phase, held out",
        "nominal, held out", "refit of two parameters, held out",
        "floor: repeats among these segments",
    ]  # fmt: skip
    assert table.rows[1][1:4] == ["8.0 (6.4 .. 10.4)", "-", "11.0"]
    assert table.rows[2][1:4] == ["48.0", "-60.0 .. -20.0, better in 1 of 1", "50.0"]
    assert table.rows[3][3] == "-"


def test_the_verdict_is_about_what_was_not_fitted() -> None:
    """How many parameters the runs determine, the held-out error with its interval, floor and baselines."""
    said = report(builders.identification(repeating=True))
    text = verdict(said)
    assert "determine 2 of 4 free parameters (1 weak, 1 not identifiable)" in text
    assert (
        "8.0 mm (6.4 .. 10.4)" in text
        and "floor 5.0 mm (repeats among these segments)" in text
        and "nothing moves 48.0" in text
    )
    assert "Nothing was held out" in verdict(said.model_copy(update={"heldout": None}))


def test_an_effect_of_which_the_runs_show_nothing_is_named() -> None:
    """With what goes on without it; not one of which a number is known, nor one whose numbers all were given."""
    made = report(builders.identification())
    one = next(found for found in made.parameters.values() if found.trust == "not identifiable")
    numbers = {
        "obstacle.height_m": "not identifiable", "obstacle.width_m": "fixed", "payload.mass_kg.0": "weak",
        "payload.place_m.0": "not identifiable", "ground_slope.angle_x_rad": "fixed",
    }  # fmt: skip
    parameters = {name: one.model_copy(update={"trust": trust}) for name, trust in numbers.items()}
    effects = ("obstacle", "payload", "ground_slope")
    said = verdict(made.model_copy(update={"parameters": parameters, "effects": effects}))
    assert "The runs show nothing of obstacle; to go on without: --with-effect none. Held out" in said
    assert "show nothing" not in verdict(made)


def test_an_interval_that_holds_zero_is_undecided() -> None:
    """Better in every segment and still undecided: the row says both, and the verdict names the rival."""
    said = report(builders.identification(repeating=True))
    held = said.heldout
    assert held is not None
    rival = held.baselines["nominal"].model_copy(update={"difference": Intervals(keyframe_cap_rmse_m=(-0.0028, 2e-4))})
    said = said.model_copy(update={"heldout": held.model_copy(update={"baselines": {"nominal": rival}})})
    rows = next(table for table in report_tables(said) if table.title.startswith("errors")).rows
    assert rows[2][2] == "-2.8 .. 0.2 (undecided), better in 1 of 1"
    assert verdict(said).endswith(" Not decided against: nominal.")


def test_a_rival_of_fewer_segments_says_so() -> None:
    """A rival that one of two held-out segments knows: with its count in the table and in the verdict."""
    said = report(builders.identification(repeating=True))
    test = next(one for one in said.segments if one.role == "test")
    other = test.model_copy(update={"interval": test.interval + 1, "baselines": {}})
    said = said.model_copy(update={"segments": (*said.segments, other)})
    rows = next(table for table in report_tables(said) if table.title.startswith("errors")).rows
    assert any(row[0] == "nothing moves, held out (1 of 2 segments)" for row in rows)
    assert "nothing moves 48.0 (1 of 2 segments)" in verdict(said)


def test_the_paper_method_speaks_of_no_determination() -> None:
    """It is the method that gives no uncertainty; the runs say nothing either way."""
    said = report(builders.identification(repeating=True)).model_copy(update={"method": "paper"})
    assert verdict(said).startswith("The method gives no uncertainty")


def test_an_endless_interval_does_not_hide_the_others() -> None:
    """A parameter that is off by a factor of a million leaves the picture drawable."""
    data = changed("parameters", "upper", np.array([0.82, 1e6, np.nan, np.nan]))
    name, _, png = next(draw_identification(data))
    assert name == "parameters" and len(png) > 5000


def test_a_value_beyond_the_axis_is_marked_at_its_edge() -> None:
    """An empty dot with its number; a value on the axis has a full one and no number."""
    table = builders.identification(repeating=True).groups["parameters"]
    value, scale = table["value"].copy(), np.where(table["start"] == 0, 1.0, np.abs(table["start"]))
    plain = parameters_figure(builders.identification(repeating=True)).axes[0]
    assert not plain.texts
    value[0] = 10 * scale[0]
    axes = parameters_figure(changed("parameters", "value", value)).axes[0]
    right = axes.get_xlim()[1]
    (dot,) = [one for one in axes.lines if one.get_markerfacecolor() == "white" and np.size(one.get_xdata())]
    assert np.ravel(dot.get_data()).tolist() == [right, 0.0] and not dot.get_clip_on()
    assert [text.get_text() for text in axes.texts] == ["10"]


def test_what_rounding_leaves_of_zero_is_zero() -> None:
    """In shares of the bounds; a small number of a small range stays."""
    assert near_zero(-5.412e-17, -0.1, 0.1) == 0.0 == near_zero(1e-14)
    assert near_zero(1e-9, 0.0, 1e-6) == 1e-9 and near_zero(2.0, None, float("inf")) == 2.0
    said = report(builders.identification(repeating=True))
    held = said.parameters["restitution"].model_copy(update={"value": -5e-17})
    table = next(iter(report_tables(said.model_copy(update={"parameters": {"restitution": held}}))))
    assert table.rows[0][1] == "0"


def test_the_simulator_alone_has_its_own_row_and_columns() -> None:
    """With what repeats as the prediction: the controller in the loop belongs to the simulator, and a test segment has
    the errors of both."""
    said = report(builders.identification(repeating=True))
    assert said.heldout is not None
    alone = said.heldout.baselines["nominal"].model_copy(update={"keyframe_cap_rmse_m": 0.009})
    held = said.heldout.model_copy(update={
        "predictor": "identified + what repeats", "free_run_closed_loop_cap_mean_m": 0.02,
        "baselines": {"identified": alone, **said.heldout.baselines},
    })  # fmt: skip
    test = next(one for one in said.segments if one.role == "test")
    own = {"identified": test.keyframe_cap_rmse_m, **test.baselines}
    test = test.model_copy(update={"predicted_cap_rmse_m": 0.004, "baselines": own})
    train = next(one for one in said.segments if one.role == "train")
    tables = list(report_tables(said.model_copy(update={"heldout": held, "segments": (train, test)})))
    errors = next(table for table in tables if table.title.startswith("errors"))
    closed = {row[0]: row[-1] for row in errors.rows}
    assert closed["identified, held out"] == "20.0" and closed["identified + what repeats, held out"] == "-"
    segments = next(table for table in tables if table.title.startswith("segments"))
    assert len(set(segments.columns)) == len(segments.columns)
    rows = [dict(zip(segments.columns, row, strict=True)) for row in segments.rows]
    assert [row["identified + what repeats [mm]"] for row in rows] == ["-", "4.0"]
    assert rows[1]["identified [mm]"] == f"{1e3 * test.keyframe_cap_rmse_m:.1f}"


def test_nothing_known_of_the_information_is_drawn() -> None:
    """A spectrum of zeros (no run says anything) has no logarithm, and is drawn."""
    data = changed("identifiability", "eigenvalue", np.zeros(4))
    assert draw_information(data) != draw_information(builders.identification(repeating=True))


def test_long_words_do_not_run_into_each_other() -> None:
    """Four parameters with long names in every direction: no label of the spectrum lies over its neighbour."""
    long = " and ".join(["raising some_long_name.11 by 0.0123 N/m"] * 6).encode()
    figure = information_figure(changed("identifiability", "words", np.array([long] * 4)))
    figure.canvas.draw()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_yticklabels()]
    boxes.sort(key=lambda box: box.y0)
    assert len(boxes) == 4 and len(figure.axes[0].get_yticklabels()[0].get_text().splitlines()) >= 4
    assert all(low.y1 <= high.y0 for low, high in pairwise(boxes))


def test_the_error_of_a_frame_is_over_the_caps_that_are_seen() -> None:
    """Root of the mean square distance: 3-4-5, a cap that is not seen does not count, none seen is NaN."""
    error = np.array([[[3, 4, 0], [0, 0, 0]], [[3, 4, 0], [np.nan] * 3], [[np.nan] * 3] * 2])
    assert cap_rmse(error) == pytest.approx([np.sqrt(12.5), 5.0, np.nan], nan_ok=True)


def test_the_floor_is_that_of_the_key_frames() -> None:
    """The last one that is known; NaN where none is."""
    measures = builders.identification(repeating=True).groups["measures"]
    assert floor_of(measures) == 0.005
    unknown = changed("measures", "floor", np.full(3, np.nan)).groups["measures"]
    assert np.isnan(floor_of(unknown))


def test_the_self_test_as_a_table() -> None:
    """Bias with its sign, coverage in per cent; what was never identifiable has neither sd nor coverage."""
    sure = Recovered(unit="1", bias=-0.002, rmse=0.01, sd_reported=0.011, coverage=0.95, identifiable=1.0)
    never = Recovered(unit="N s/m", bias=0.5, rmse=1.0, sd_reported=None, coverage=None, identifiable=0.0)
    case = RecoveredCase(truth={}, value={}, sd={}, covered={}, converged=True, rollouts=10)
    found = SelfTestReport(cases=(case,) * 20, parameters={"friction": sure, "damping": never}, noise_m=0.001,
                           converged=0.95, seed=0)  # fmt: skip
    (table,) = self_test_tables(found)
    assert table.rows == [["friction", "1", "-0.002", "0.01", "0.011", "95%", "100%"],
                          ["damping", "N s/m", "+0.5", "1", "-", "-", "0%"]]  # fmt: skip
    assert table.title == "self-test, simulated: 20 planted robots, noise 1.0 mm, 95% converged"


def errors_figure(data: ArtifactData, monkeypatch: pytest.MonkeyPatch) -> Figure:
    """The picture of errors, as a figure."""
    figures: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("r2s2r_cli.views.identify_errors.png_bytes", kept)
    draw_errors(data)
    return figures[0]


def test_what_repeats_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is a baseline, too, where it is not the prediction: one mark and one name for one number."""
    name = "identified + what repeats"
    data = changed("measures", "baseline", np.array([name, "nominal", "nothing moves", "repeat"], dtype="S"))
    legend = errors_figure(data, monkeypatch).axes[0].get_legend()
    assert legend is not None
    words = [text.get_text() for text in legend.texts]
    assert words.count(name) == 1 and {"nominal", "nothing moves", "repeat"} <= set(words)
    alone = replace(data, groups={path: group for path, group in data.groups.items() if path != "repeating"})
    legend = errors_figure(alone, monkeypatch).axes[0].get_legend()
    assert legend is not None and [text.get_text() for text in legend.texts].count(name) == 1


def test_many_segments_have_names_that_can_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several runs with long names: no name lies on its neighbour, and a segment is below its own bar."""
    data = builders.identification()
    group = data.groups["segments"]
    many = {key: np.concatenate([value] * 12) for key, value in group.datasets.items()}
    many["run"] = np.array([f"turn-counterclockwise-{k}".encode() for k in range(len(many["run"]))])
    many["lag1"] = np.full_like(many["lag1"], np.nan)
    figure = errors_figure(replace(data, groups={**data.groups, "segments": Group(many)}), monkeypatch)
    figure.canvas.draw()
    top, bottom = figure.axes[:2]
    for axes in (top, bottom):
        boxes = sorted((label.get_window_extent() for label in axes.get_xticklabels()), key=lambda box: box.x0)
        assert len(boxes) == len(many["run"]) and all(left.x1 <= right.x0 for left, right in pairwise(boxes))
    assert top.get_xlim() == bottom.get_xlim()
    assert bottom.get_title().endswith("grey: too few frames")


def test_estimates_as_runs_arrived_have_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the names, but for numbers without one."""
    figures: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("r2s2r_cli.views.identify_search.png_bytes", kept)
    data = builders.identification()
    draw_history(data)
    table = data.groups["parameters"]
    pairs = [(name.decode(), unit.decode()) for name, unit in zip(table["name"], table["unit"], strict=True)]
    assert [axes.get_title() for axes in figures[0].axes] == [
        name if unit == "1" else f"{name} [{unit}]" for name, unit in pairs
    ]
    assert any("[" in axes.get_title() for axes in figures[0].axes)


def test_a_search_is_called_what_it_shows() -> None:
    """Without profiles there is no word of them."""
    for left_out, said in (("profiles", "Loss on the way of the fit"), ("trace", "Profile likelihood of the weakest")):
        drawn = draw_identification(without(left_out))
        assert next(title for name, title, _ in drawn if name == "search") == said
