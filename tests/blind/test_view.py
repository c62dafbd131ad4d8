"""The page of a score says what the table says."""

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from r2s2r_cli.blind.score import score_of
from r2s2r_cli.views.blind import _interval, blind_page, blind_tables, draw_blind
from r2s2r_cli.views.blind_markdown import blind_markdown
from schemas.results_blind import BlindRow
from tests.support import blind_bank


def test_tables_and_page_hold_every_figure() -> None:
    """A row a metric with interval and verdict, `not shown` where the interval holds the target; both pictures."""
    labels = blind_bank.bank(60)
    result = score_of(blind_bank.answered(labels, blind_bank.by_chance), tier="B", bank="test", sets=60, index="f00")
    figures, recall, worth, splits, misses = blind_tables(result)
    assert len(worth.columns) == 2 + len(result.baselines) and len(worth.rows[0]) == len(worth.columns)
    assert [row[:3] for row in splits.rows] == [[one.by, one.value, str(one.sets)] for one in result.splits]
    assert len(figures.rows) == len(result.rows) and len(recall.rows) == len(result.recall)
    assert len(misses.rows) == len(result.misses)
    for row, shown in zip(result.rows, figures.rows, strict=True):
        assert shown[3] == str(row.n)
        assert ("not shown" in shown[5]) == (row.shown is False)
        if row.passed is not None:
            assert shown[5].startswith("reached" if row.passed else "missed")
    pictures = dict(draw_blind(result))
    assert set(pictures) == {"confusion", "calibration"}
    assert all(png.startswith(b"\x89PNG") for png in pictures.values())
    page = blind_page(result, pictures).decode()
    assert page.count("data:image/png") == 2 and "f00" in page and all(row.what in page for row in result.rows[:5])


def test_an_interval_that_is_not_finite_says_so_once() -> None:
    """Not `not finite to not finite`; where one end is, both are told; of a number without an interval that they are
    too few."""
    row = BlindRow(name="loss", what="loss", target=None, above=False, unit="number", value=None, n=3, low=None,
                   high=None, passed=None, shown=None)  # fmt: skip
    assert _interval(row) == "not finite"
    assert _interval(row.model_copy(update={"low": 1.0})) == "1.0 to not finite"
    assert _interval(row.model_copy(update={"value": 2.0})) == "too few"


def test_a_place_that_was_not_said_is_told_in_words() -> None:
    """Half of the sets without a place have no finite median: in table, Markdown and page stands how many say none,
    and the target is missed all the same."""
    label = next(one for one in blind_bank.bank(60) if one["effects"] and one["effects"][0]["id"] == "friction_field")
    clear = {**label, "kind": "single", "effects": label["effects"][:1], "d": 20.0, "d_each": [20.0], "outside": None}

    def some(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
        found = blind_bank.always(label, rng)
        return found if label["says"] else {**found, "where": {"channel": "contact"}}

    for say, silent, value, interval in (
        (2, 2, "no place said in 2 of 4", ""), (4, 4, "no place said in 4 of 8", "30.0 cm to no place said"),
        (3, 1, "30.0 cm", "too few"),
    ):  # fmt: skip
        answered = blind_bank.answered([{**clear, "says": i < say} for i in range(say + silent)], some)
        result = score_of(answered, tier="B", bank="test", sets=len(answered), index="0")
        rows = [row for row in next(blind_tables(result)).rows if row[0].startswith("distance")]
        assert [row[1:3] for row in rows] == [[value, interval]] and rows[0][5].startswith("missed")
        text = blind_markdown(result)
        assert f"| {value} | {interval} | {say + silent} |" in text and "not finite" not in text


def test_confusion_counts_every_decided_set_once() -> None:
    """Rows are truths, columns first guesses; pairs, weak and faint sets stand nowhere in it."""
    labels = blind_bank.bank(200, seed=3)
    result = score_of(blind_bank.answered(labels, blind_bank.right), tier="B", bank="test", sets=200, index="0")
    counts = np.array(result.confusion)
    assert counts.shape == (len(result.classes),) * 2 and np.array_equal(counts, np.diag(np.diag(counts)))
    assert counts[result.classes.index("none")].sum() == sum(one["kind"] == "none" for one in labels)


def test_markdown_holds_the_same_tables() -> None:
    """Every table of the terminal, cell by cell; bars and line breaks in a cell do not break its row; what was said of
    a truth adds up to its row of the matrix."""
    labels = blind_bank.bank(60)
    result = score_of(blind_bank.answered(labels, blind_bank.by_chance), tier="B", bank="test|b", sets=61, index="f00")
    text = blind_markdown(result)
    tables = [part for part in text.split("## ") if part]
    assert len(tables) == len(list(blind_tables(result))) + 1
    for part, table in zip(tables, blind_tables(result), strict=False):
        lines = [line for line in part.splitlines() if line.startswith("|")]
        assert len(lines) == len(table.rows) + 2
        assert {line.replace("\\|", "").count("|") for line in lines} == {len(table.columns) + 1}
    said = [line.split(" | ")[1] for line in tables[-1].splitlines() if line.startswith("| ")][2:]
    counts = [sum(int(one.split()[1]) for one in line.rstrip(" |").split(", ")) for line in said]
    assert counts == [sum(row) for row in result.confusion if any(row)]


def test_no_number_of_the_calibration_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of guesses that are never right, and of those that always are: within the axes, and so not on their ticks."""
    figures: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        figures.append(figure)
        return b""

    monkeypatch.setattr("r2s2r_cli.views.blind.png_bytes", kept)
    labels = blind_bank.bank(60)
    result = score_of(blind_bank.answered(labels, blind_bank.by_chance), tier="B", bank="test", sets=60, index="f00")
    ends = [result.calibration[0].model_copy(update={"said": end, "right": end, "n": 888}) for end in (0.0, 1.0)]
    assert "calibration" in dict(draw_blind(result.model_copy(update={"classes": [], "calibration": ends})))
    axes = figures[0].axes[0]
    figures[0].canvas.draw()
    box = axes.get_window_extent()
    numbers = [text.get_window_extent() for text in axes.texts]
    assert len(numbers) == 2
    assert all(box.x0 <= one.x0 and one.x1 <= box.x1 and box.y0 <= one.y0 and one.y1 <= box.y1 for one in numbers)


def test_pictures_say_what_they_show() -> None:
    """Above them, and where they cannot be seen."""
    labels = blind_bank.bank(60)
    result = score_of(blind_bank.answered(labels, blind_bank.by_chance), tier="B", bank="test", sets=60, index="f00")
    page = blind_page(result, {"confusion": b"", "calibration": b""}).decode()
    assert 'alt="what was guessed first for every truth"' in page and 'alt="how often the first guess was right' in page
