"""Pictures of a diagnosis: nothing lies outside of them, and their legends say what every mark means."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.diagnose import draw_diagnosis, judged_picture
from r2s2r_cli.views.figure import BLUE
from tests.support.diagnosed import report


def gap() -> ArtifactData:
    """Two runs of two intervals; one stands out."""
    refit = np.array([0.002, 0.003, 0.1, 0.004])
    segments = Group({
        "run": np.array([b"a", b"a", b"b", b"b"]), "interval": np.array([1, 2, 1, 2]), "gap": refit > 0.05,
        "t": np.array([[0.0, 1.0], [1.0, 2.0], [0.0, 1.0], [1.0, 2.0]]), "refit": refit, "effect": refit / 2,
    })  # fmt: skip
    return ArtifactData("diagnosis", {"segments": segments})


def test_no_error_lies_outside_of_its_picture(figures: list[Figure]) -> None:
    """Panels share an axis of errors: the largest of the last run is seen as well, and 0 is its lower end."""
    name, _, _ = next(draw_diagnosis(gap(), report()))
    assert name == "gap"
    for axes in figures[0].axes:
        low, high = axes.get_ylim()
        assert low == 0.0 and high > 100.0


def test_bands_and_numbers_of_intervals_are_explained(figures: list[Figure]) -> None:
    """Bands are coloured by another measure than points are drawn by, so the highest may be on grey."""
    next(draw_diagnosis(gap(), report()))
    words = [text.get_text() for text in figures[0].legends[0].texts]
    assert "orange: stands out over the whole interval, not at its end alone" in words
    assert "grey: a target interval that does not stand out" in words
    assert "target interval" in [text.get_text() for text in figures[0].axes[0].texts]


@pytest.mark.parametrize("names", [("b:1",), ("b:1", "b:2", "b:3")])
def test_the_legend_of_judged_intervals_is_whole(figures: list[Figure], names: tuple[str, ...]) -> None:
    """Within the picture, however narrow; in full colours though the first interval is set aside; with the median."""
    known = report().shrinkage
    assert known is not None
    long = known.model_copy(update={"effects": ("motor_speed_mismatch", "tendon_stiffness"), "set_aside": ("b:1",)})
    values = np.linspace(0.01, 0.02, len(names))
    group = Group({"name": np.array([name.encode() for name in names]), "nominal": values, "refit": values,
                   "effect": values, "ceiling": values})  # fmt: skip
    judged_picture(ArtifactData("diagnosis", {"judged": group}), report().model_copy(update={"shrinkage": long}))
    (figure,) = figures
    figure.canvas.draw()
    legend = figure.legends[0]
    box = legend.get_window_extent()
    assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1
    marks = dict(zip([text.get_text() for text in legend.texts], legend.legend_handles, strict=True))
    assert marks["refit"].get_facecolor() == to_rgba(BLUE)  # type: ignore[union-attr]
    assert "median of all together" in marks


@pytest.mark.parametrize("run", [b"a", b"b"])
def test_a_curve_of_one_run_alone_is_in_the_legend(figures: list[Figure], run: bytes) -> None:
    """Whichever it is."""
    rows = gap().groups["segments"]
    effect = np.where(rows["run"] == run, rows["effect"], np.nan)
    next(draw_diagnosis(ArtifactData("diagnosis", {"segments": Group({**rows.datasets, "effect": effect})}), report()))
    words = [text.get_text() for text in figures[0].legends[0].texts]
    assert sorted(words[:3]) == ["floor", "refit", "refit + payload"] and len(set(words)) == len(words)


@pytest.mark.parametrize(("lost", "said"), [(True, True), (False, False)])
def test_points_that_are_missing_are_explained_without_an_effect(figures: list[Figure], lost: bool, said: bool) -> None:
    """Where no effect was fitted a cap may be lost as well; an effect that was not fitted loses none."""
    rows = gap().groups["segments"]
    refit = rows["refit"].copy()
    refit[1] = np.nan if lost else refit[1]
    none = Group({**rows.datasets, "refit": refit, "effect": np.full(4, np.nan)})
    next(draw_diagnosis(ArtifactData("diagnosis", {"segments": none}), report()))
    words = [text.get_text() for text in figures[0].legends[0].texts]
    assert ("no point: a cap ended more than 25 cm off" in words) == said
