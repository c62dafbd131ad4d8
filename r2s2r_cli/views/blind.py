"""The score of blind trials as tables for the terminal and the HTML page, and its two pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from r2s2r_cli.views.figure import new_figure, png_bytes
from r2s2r_cli.views.page import Page, PageTable, Picture, render
from schemas.results_blind import BlindRow, BlindScoreResult

_INK, _PALE = "#0b5fa5", "#8792a2"
_TITLES = {
    "confusion": "what was guessed first for every truth",
    "calibration": "how often the first guess was right, by the probability that it was given",
}
_WHOLE = (-0.05, 1.09)
"""Shares with room for marks at their ends, and for the numbers above them."""


def blind_tables(result: BlindScoreResult) -> Iterator[PageTable]:
    """Every figure with its interval; recall by effect; what figures are worth; splits; shards; the misses."""
    strata = ", ".join(f"{n} {name}" for name, n in sorted(result.strata.items()))
    yield PageTable(
        f"tier {result.tier}, {result.bank} bank: {result.scored} of {result.sets} sets ({strata})",
        ["figure", "value", "95 %", "n", "target", "verdict"],
        [[row.what, _value(row), _interval(row), str(row.n), _target(row), _verdict(row)]
         for row in result.rows],
    )  # fmt: skip
    if result.recall:
        yield PageTable(
            "single effects: first guess, first three and named, of the clear sets",
            ["effect", "sets", "clear", "first", "in three", "named"],
            [[r.effect, str(r.sets), str(r.clear), _of(r.top1, r.clear), _of(r.top3, r.clear), _of(r.named, r.clear)]
             for r in result.recall],
        )  # fmt: skip
    if result.baselines:
        yield _worth(result)
    if result.splits:
        yield _splits(result)
    if len(result.shards) > 1:
        yield PageTable(
            "shards: banks with a key and a list each",
            ["bank", "sets", "judged", "code", "list (SHA-256)"],
            [[one.where, str(one.sets), str(one.scored),
              ", ".join(code[:12] for code in one.commits or one.sources_sha256) or "not known", one.index_sha256]
             for one in result.shards],
        )  # fmt: skip
    if result.misses:
        yield PageTable(
            "misses: first guess wrong on a clear set, or where nothing is wrong",
            ["set", "truth", "d", "said", "p", "rank of the truth", "verdict", "what is known of it"],
            [[m.set, m.truth, f"{m.d:.1f}", m.said, "" if m.probability is None else f"{m.probability:.2f}",
              "not ranked" if m.rank is None else str(m.rank), m.verdict, m.why] for m in result.misses],
        )  # fmt: skip


def _worth(result: BlindScoreResult) -> PageTable:
    """Figures beside those of diagnosers that look at nothing, where these have any."""
    told = [row for row in result.rows if any(row.name in one.values for one in result.baselines)]
    return PageTable(
        "what a figure is worth: the same of diagnosers that look at nothing",
        ["figure", "found", *(one.name for one in result.baselines)],
        [[row.what, _value(row),
          *(_number(row, one.values[row.name]) if row.name in one.values else "" for one in result.baselines)]
         for row in told],
    )  # fmt: skip


def _splits(result: BlindScoreResult) -> PageTable:
    return PageTable(
        "by noise, gaits and rate (of the clear single effects; alarms of the sets with nothing wrong)",
        ["by", "value", "sets", "clear", "first", "in three", "named", "named rightly", "alarms", "CPU, median"],
        [[one.by, one.value, str(one.sets), str(one.clear), _of(one.top1, one.clear), _of(one.top3, one.clear),
          _of(one.named, one.clear), _of(one.right, one.named), _of(one.alarms, one.none),
          "" if one.cpu_median_s is None else f"{one.cpu_median_s:.0f} s"] for one in result.splits],
    )  # fmt: skip


def draw_blind(result: BlindScoreResult) -> Iterator[tuple[str, bytes]]:
    """(name, PNG) of the confusion matrix and the calibration curve."""
    if result.classes:
        yield "confusion", _confusion(result)
    if result.calibration:
        yield "calibration", _calibration(result)


def blind_page(result: BlindScoreResult, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page."""
    asked = [row for row in result.rows if row.passed is not None]
    passed = sum(bool(row.passed) for row in asked)
    open_ = sum(row.shown is False for row in asked)
    return render(
        Page(
            title=f"Blind trials of diagnose, tier {result.tier}",
            sentence=f"{passed} of {len(asked)} figures reach their target on {result.scored} sets; of {open_} the "
            f"interval still holds the target. Commitment of the labels: {result.index_sha256}.",
            labels=result.warnings,
            tables=list(blind_tables(result)),
            pictures=[Picture(_TITLES.get(name, name), png) for name, png in pictures.items()],
        )
    )


def _confusion(result: BlindScoreResult) -> bytes:
    counts = np.array(result.confusion, dtype=float)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    n = len(result.classes)
    figure = new_figure(2.5 + 0.34 * n, 2.0 + 0.34 * n)
    axes = figure.subplots()
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1)
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(j, i, f"{int(counts[i, j])}", ha="center", va="center", fontsize=7,
                  color="white" if share[i, j] > 0.5 else "black")  # fmt: skip
    axes.set_xticks(range(n), result.classes, rotation=90, fontsize=7)
    axes.set_yticks(range(n), result.classes, fontsize=7)
    axes.set(xlabel="first guess", ylabel="truth", title="number of sets; shade: share of the row")
    return png_bytes(figure)


def _calibration(result: BlindScoreResult) -> bytes:
    figure = new_figure(5.0, 4.6)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=_PALE, lw=1, label="as said")
    said = [one.said for one in result.calibration]
    right = [one.right for one in result.calibration]
    axes.plot(said, right, color=_INK, marker="o", label="found")
    for one in result.calibration:
        axes.annotate(str(one.n), (one.said, one.right), textcoords="offset points", xytext=(5, 4), fontsize=8)
    axes.set(xlabel="probability of the first guess", ylabel="how often it was right", xlim=_WHOLE, ylim=_WHOLE,
             title="calibration, with the number of sets")  # fmt: skip
    axes.legend(fontsize=8)
    return png_bytes(figure)


def _value(row: BlindRow) -> str:
    """The figure; where it is infinitely far, what was not said."""
    if row.value is None and row.unsaid:
        return f"no place said in {row.unsaid} of {row.n}"
    return _number(row, row.value)


def _number(row: BlindRow, value: float | None) -> str:
    if value is None:
        return "none" if not row.n else "not finite"
    return {"share": f"{100 * value:.0f} %", "m": f"{100 * value:.1f} cm", "number": f"{value:.1f}"}[row.unit]


def _interval(row: BlindRow) -> str:
    if not row.n or row.low is row.high is None:
        told = not row.n or (row.value is None and row.unsaid)  # the value says all there is
        return "" if told else "not finite" if row.value is None else "too few"
    if row.unsaid and row.high is None:
        return f"{_number(row, row.low)} to no place said"
    return f"{_number(row, row.low)} to {_number(row, row.high)}"


def _target(row: BlindRow) -> str:
    return "" if row.target is None else f"{'at least' if row.above else 'at most'} {_number(row, row.target)}"


def _verdict(row: BlindRow) -> str:
    if row.passed is None:
        return "" if row.target is None else "nothing to count"
    return ("reached" if row.passed else "missed") + ("" if row.shown else ", not shown")


def _of(part: int, whole: int) -> str:
    return f"{part}/{whole}" if whole else ""
