"""Pictures of a diagnosis: gap over time, the robot with what is guilty, the floor, the ranking, before and after."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.diagnose_floor import floor_picture
from r2s2r_cli.views.diagnose_ranking import NOWHERE, element_words
from r2s2r_cli.views.figure import BLUE, GREEN, PURPLE, RED, new_figure, png_bytes, rod_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from schemas.results_diagnose import DiagnoseReport

GUILTY = RED
PLAIN = "#8792a2"
NINETY = 1.645
"""Sd to either side of a 90 % interval."""
LABELS = 60
"""Letters that fit below an axis side by side."""
BEFORE, AFTER, STALE, BLACK_BOX = BLUE, GREEN, "#b8bec8", PURPLE


def draw_diagnosis(data: ArtifactData, report: DiagnoseReport) -> Iterator[tuple[str, str, bytes]]:
    """(name, title, PNG)."""
    yield "gap", "the gap over time: fitted target intervals, each left out", _gap(data, report)
    yield "robot", "the robot, and what is guilty", _robot(data, report)
    yield "floor", "where on the floor the gap arises", floor_picture(data, report)
    yield (
        "ranking",
        "how much better each effect explains all data, and predicts what was left out",
        _ranking(data, report),
    )
    if "judged" in data.groups:
        yield "judged", "before and after, on intervals that nothing was fitted to", _judged(data, report)


def _gap(data: ArtifactData, report: DiagnoseReport) -> bytes:
    rows = data.groups["segments"]
    runs = list(dict.fromkeys(rows["run"].tolist()))
    figure = new_figure(11.0, 3.6)
    axes = figure.subplots(
        1, len(runs), sharey=True, squeeze=False, width_ratios=[1.0 * np.sum(rows["run"] == r) for r in runs]
    )[0]
    for k, (own, run) in enumerate(zip(axes, runs, strict=True)):
        at = np.flatnonzero(rows["run"] == run)
        for row in at:
            t0, t1 = rows["t"][row]
            stands_out = bool(rows["gap"][row])
            own.axvspan(t0, t1, color=GUILTY if stands_out else PLAIN, alpha=0.14, lw=0)
            own.annotate(str(rows["interval"][row]), ((t0 + t1) / 2, 1.0), xycoords=("data", "axes fraction"),
                         ha="center", va="bottom", fontsize=7, color=PLAIN)  # fmt: skip
        middle = rows["t"][at].mean(axis=1)
        own.plot(middle, 1e3 * rows["refit"][at], "o-", color=BEFORE, label="refit", lw=1.4)
        if np.isfinite(rows["effect"][at]).any():
            own.plot(
                middle, 1e3 * rows["effect"][at], "s--", color=AFTER, label=f"refit + {_best(report)}", lw=1.2, ms=4
            )
        own.axhline(1e3 * report.floor_m, color="#111111", lw=1, ls=":", label="floor")
        own.set_xlabel(f"time [s]\n{run.decode()}", fontsize=8)
        own.tick_params(labelsize=8)
        if k == 0:
            own.set_ylabel("cap error at the end\nof an interval [mm]")
    from matplotlib.patches import Patch

    axes[0].set_ylim(bottom=0.0)  # of all panels, once every one of them is drawn
    handles, labels = axes[0].get_legend_handles_labels()
    if rows["gap"].any():
        handles.append(Patch(color=GUILTY, alpha=0.14))
        labels.append("stands out over the whole interval")
    if not np.isfinite(np.concatenate([rows["refit"], rows["effect"]])).all() and np.isfinite(rows["effect"]).any():
        handles.append(Patch(color="none"))
        labels.append("no point: a cap ended more than 25 cm off")
    figure.legend(handles, labels, loc="outside lower center", ncol=5, fontsize=8, frameon=False)
    return png_bytes(figure)


def _best(report: DiagnoseReport) -> str:
    return next((one.effect for one in report.ranking if one.effect not in ("none", "unknown")), "effect")


def _robot(data: ArtifactData, report: DiagnoseReport) -> bytes:
    """From above and from the side: rods, cables, and the guilty part thick."""
    from matplotlib.lines import Line2D

    group = data.groups["robot"]
    p = group["p_WE"] - np.array([*group["p_WE"][:, :2].mean(axis=0), 0.0])
    element = report.where.element
    figure = new_figure(9.5, 4.4)
    for axes, (i, j), title in zip(
        figure.subplots(1, 2), ((0, 1), (0, 2)), ("from above", "from the side"), strict=True
    ):
        _drawn(axes, group, p[:, [i, j]], element)
        axes.set(title=title, xlabel="x [m]", ylabel=f"{'xyz'[j]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
    figure.suptitle(guilt(report), color=GUILTY if element is not None else "#1c2430", fontsize=11)
    handles = [Line2D([], [], color=PLAIN, ls="-"), Line2D([], [], color=PLAIN, ls="--")]
    figure.legend(handles, ["winched cable", "passive cable"], loc="outside lower center", ncol=2, fontsize=8,
                  frameon=False)  # fmt: skip
    return png_bytes(figure)


def guilt(report: DiagnoseReport) -> str:
    """What is guilty, as surely as the verdict says it."""
    element, channel = report.where.element, report.where.channel
    sure = report.verdict in ("effect", "pair")
    if element is not None:
        elsewhere = ", nothing on the robot" if element.kind in ("place", "world", "camera") else ""
        part = f"{element_words(element)}{elsewhere}"
        return f"guilty: {part}" if sure else f"most suspect: {part} (verdict: {report.verdict})"
    if report.verdict == "no_gap":
        return "no part is guilty: there is no gap"
    if channel is not None:
        return (
            f"no single part{'' if sure else ' stands out'}: it acts in channel {channel} (verdict: {report.verdict})"
        )
    return f"no part stands out (verdict: {report.verdict})"


def _drawn(axes: Axes, group: Group, p: np.ndarray, element: object) -> None:
    kind = getattr(element, "kind", None)
    index = getattr(element, "index", None)

    def guilty(own: tuple[str, ...], number: int) -> bool:
        return kind in own and index in (None, number)

    for k, (a, b) in enumerate(group["cable"].tolist()):
        bad = guilty(("cable", "motor", "sensor"), k) and (kind != "motor" or bool(group["actuated"][k]))
        axes.plot(p[[a, b], 0], p[[a, b], 1], color=GUILTY if bad else PLAIN, lw=3.5 if bad else 1.0,
                  ls="-" if group["actuated"][k] else "--", zorder=3 if bad else 1)  # fmt: skip
        x, y = p[[a, b]].mean(axis=0)
        axes.annotate(str(k), (x, y), fontsize=7, color=GUILTY if bad else PLAIN, ha="center", va="center",
                      bbox={"boxstyle": "circle,pad=0.12", "fc": "white", "ec": "none"}, zorder=4)  # fmt: skip
    for rod in range(len(p) // 2):
        bad = guilty(("rod",), rod)
        ends = p[2 * rod : 2 * rod + 2]
        axes.plot(ends[:, 0], ends[:, 1], color=GUILTY if bad else rod_color(2 * rod), lw=9 if bad else 5, alpha=0.9,
                  zorder=2, solid_capstyle="round")  # fmt: skip
    for cap, (x, y) in enumerate(p):
        bad = guilty(("cap",), cap)
        axes.plot(x, y, "o", ms=19 if bad else 12, color=GUILTY if bad else rod_color(cap), zorder=5)
        axes.annotate(str(cap), (x, y), ha="center", va="center", fontsize=8, color="white", weight="bold", zorder=6)


def _ranking(data: ArtifactData, report: DiagnoseReport) -> bytes:
    """Gains over the refit nominal model on all data, beside them those on gaits left out, and probabilities."""
    del data
    rows = [one for one in report.ranking if one.effect not in ("none", "unknown")][:10]
    others = [one for one in report.ranking if one.effect in ("none", "unknown")]
    figure = new_figure(10.5, 1.4 + 0.36 * (len(rows) + len(others)))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.6, 1])
    names, told = [], False
    for y, one in enumerate([*rows, *others]):
        color = GUILTY if one.effect in report.effects else "#444f5e" if one in others else BEFORE
        if one not in others and one.fitted and one.elpd_gain > NOWHERE:
            wide = None if one.elpd_gain_sd is None else NINETY * one.elpd_gain_sd
            left.barh(y, one.marginal_nats or 0.0, color=color, height=0.6)
            left.errorbar(one.elpd_gain, y, xerr=wide, fmt="D", ms=4, mfc="white", color="#111111", capsize=3, lw=1,
                          label=None if told else "on what was left out, with 90 % interval")  # fmt: skip
            told = True
        right.barh(y, one.probability, color=color, height=0.6)
        right.annotate(f"{one.probability:.2f}", (one.probability, y), xytext=(4, 0), textcoords="offset points",
                       va="center", fontsize=8)  # fmt: skip
        where = "" if one.element is None else f", {element_words(one.element)}"
        names.append(f"{one.effect}{where}")
    left.axvline(report.chance_nats, color="#111111", lw=1, ls=":", label="reached left out by chance in 1 case of 20")
    left.axvline(0.0, color="#111111", lw=0.8)
    left.set_yticks(range(len(names)), names, fontsize=8)
    left.invert_yaxis()
    left.set_xlabel("gain on all data [nats]", fontsize=8)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", fontsize=8, frameon=False)
    right.set(xlim=(0, 1.15))
    right.set_xlabel("probability", fontsize=8)  # where it comes from is in the table "how"
    return png_bytes(figure)


def _judged(data: ArtifactData, report: DiagnoseReport) -> bytes:
    group = data.groups["judged"]
    names = [name.decode() for name in group["name"].tolist()]
    figure = new_figure(min(13.0, 5.0 + 0.6 * len(names)), 3.8)
    each, all_ = figure.subplots(1, 2, sharey=True, width_ratios=[min(max(2.0, 0.5 * len(names)), 7.0), 1.0])
    series = (("nominal", STALE, "as identified"), ("refit", BEFORE, "refit"),
              ("effect", AFTER, "refit + " + (" + ".join(report.shrinkage.effects) if report.shrinkage else "effect")),
              ("ceiling", BLACK_BOX, "black box"))  # fmt: skip
    width = 0.8 / len(series)
    aside = () if report.shrinkage is None else report.shrinkage.set_aside
    counts = np.array([name not in aside for name in names], dtype=bool)
    floor = report.floor_m if report.shrinkage is None else report.shrinkage.floor
    for k, (name, color, label) in enumerate(series):
        x = np.arange(len(names)) - 0.4 + (k + 0.5) * width
        values = 1e3 * group[name]
        bars = each.bar(x, np.nan_to_num(values), width, color=color, label=label)
        for bar in np.array(bars.patches)[~counts]:
            bar.set(alpha=0.25)
        values = values[counts]
        if np.isfinite(values).any():
            all_.bar(k, float(np.sqrt(np.nanmean(values**2))), 0.7, color=color)
            # A fall or two decide the root mean square.
            all_.plot(k, float(np.nanmedian(values)), "_", color="#111111", ms=12, mew=2)
    for axes in (each, all_):
        axes.axhline(1e3 * floor, color="#111111", lw=1, ls=":", label="floor of judged intervals")
    if aside:
        each.set_title("pale: set aside, as in the floor", fontsize=9)
    turned = sum(map(len, names)) > LABELS
    each.set_xticks(
        range(len(names)), names, rotation=45 if turned else 0, ha="right" if turned else "center", fontsize=8
    )
    each.set_ylabel("cap error at the key frame [mm]")
    all_.set_xticks(
        range(len(series)), ["identified", "refit", "+ effect", "black box"], rotation=45, ha="right", fontsize=8
    )
    all_.set_title("all together: root\nmean square, median", fontsize=9)
    handles, labels = each.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=5, fontsize=8, frameon=False)
    return png_bytes(figure)
