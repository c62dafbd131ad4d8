"""Pictures of a diagnosis: gap over time, the robot with what is named, the floor, the ranking, before and after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.diagnose_floor import floor_picture
from r2s2r_cli.views.diagnose_gains import ranking_picture
from r2s2r_cli.views.diagnose_robot import robot_picture
from r2s2r_cli.views.diagnose_words import HELD_OUT, LEFT_OUT, MARKED, PLAIN, accused, drawn_effects
from r2s2r_cli.views.figure import BLUE, GREEN, PURPLE, legend_columns, legend_entries, new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from schemas.results_diagnose import DiagnoseReport

BAND = 0.14
"""How much of its colour an interval's band has."""
FLOOR = "floor of held-out intervals"
LABELS = 60
"""Letters that fit below an axis side by side."""
_SHORT = {"nominal": "identified", "refit": "refit", "effect": "+ effect", "ceiling": "black box"}
BEFORE, AFTER, STALE, BLACK_BOX = BLUE, GREEN, "#b8bec8", PURPLE


def draw_diagnosis(
    data: ArtifactData, report: DiagnoseReport, asked: Sequence[str] = ()
) -> Iterator[tuple[str, str, bytes]]:
    """(name, title, PNG). asked: effects that the ranking shows whatever is known of them."""
    yield (
        "gap",
        f"{LEFT_OUT} over time: fitted target intervals, each predicted by a fit without it",
        _gap(data, report),
    )
    yield (
        "robot",
        "the robot" if accused(report) is None else "the robot, and the part that the verdict names",
        robot_picture(data, report),
    )
    yield "floor", "where on the floor the gap arises", floor_picture(data, report)
    yield (
        "ranking",
        "how much better each effect explains all data, predicts what was left out, and what the logs alone say for it",
        ranking_picture(report, asked),
    )
    if "judged" in data.groups:
        yield (
            "judged",
            f"before and after: {HELD_OUT}, of intervals that nothing was fitted to",
            judged_picture(data, report),
        )


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
            own.axvspan(t0, t1, color=MARKED if stands_out else PLAIN, alpha=BAND, lw=0)
            own.annotate(str(rows["interval"][row]), ((t0 + t1) / 2, 1.0), xycoords=("data", "axes fraction"),
                         ha="center", va="bottom", fontsize=7, color=PLAIN)  # fmt: skip
        middle = rows["t"][at].mean(axis=1)
        own.plot(middle, 1e3 * rows["refit"][at], "o-", color=BEFORE, label="refit", lw=1.4)
        if np.isfinite(rows["effect"][at]).any():
            label = f"refit + {' + '.join(drawn_effects(report))}"
            own.plot(middle, 1e3 * rows["effect"][at], "s--", color=AFTER, label=label, lw=1.2, ms=4)
        own.axhline(1e3 * report.floor_m, color="#111111", lw=1, ls=":", label="floor")
        own.set_xlabel(f"time [s]\n{run.decode()}", fontsize=8)
        own.tick_params(labelsize=8)
        if k == 0:
            own.set_ylabel(f"{LEFT_OUT} of the caps\nat the end of an interval [mm]")
    from matplotlib.patches import Patch

    axes[0].annotate("target interval", (0.0, 1.0), xycoords="axes fraction", xytext=(-4, 0),
                     textcoords="offset points", ha="right", va="bottom", fontsize=7, color=PLAIN)  # fmt: skip
    axes[0].set_ylim(bottom=0.0)  # of all panels, once every one of them is drawn
    entries = legend_entries(axes)  # of all panels: there may be no point of the effect in the first one
    handles, labels = list(entries.values()), list(entries)
    if not rows["gap"].all():
        handles.append(Patch(color=PLAIN, alpha=BAND))
        labels.append("grey: a target interval that does not stand out")
    if rows["gap"].any():
        handles.append(Patch(color=MARKED, alpha=BAND))
        # Points are of an interval's end alone, so the highest one need not be on orange.
        labels.append("orange: stands out over the whole interval, not at its end alone")
    curves = [rows["refit"], *([rows["effect"]] if np.isfinite(rows["effect"]).any() else [])]
    if not np.isfinite(curves).all():
        handles.append(Patch(color="none"))
        labels.append("no point: a cap ended more than 25 cm off")
    _legend(figure, handles, labels)
    return png_bytes(figure)


def _legend(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    columns = legend_columns(figure.get_figwidth(), labels)
    figure.legend(handles, labels, loc="outside lower center", ncol=columns, fontsize=8, frameon=False)


def judged_picture(data: ArtifactData, report: DiagnoseReport) -> bytes:
    """PNG: errors of judged intervals, each and together; those that are set aside are pale."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    group = data.groups["judged"]
    names = [name.decode() for name in group["name"].tolist()]
    figure = new_figure(min(13.0, 5.0 + 0.6 * len(names)), 3.8)
    each, all_ = figure.subplots(1, 2, sharey=True, width_ratios=[min(max(2.0, 0.5 * len(names)), 7.0), 1.0])
    known = (("nominal", STALE, "as identified"), ("refit", BEFORE, "refit"),
              ("effect", AFTER, "refit + " + (" + ".join(report.shrinkage.effects) if report.shrinkage else "effect")),
              ("ceiling", BLACK_BOX, "black box"))  # fmt: skip
    series = tuple(one for one in known if np.isfinite(group[one[0]]).any())
    width = 0.8 / len(series)
    aside = () if report.shrinkage is None else report.shrinkage.set_aside
    counts = np.array([name not in aside for name in names], dtype=bool)
    floor = report.floor_m if report.shrinkage is None else report.shrinkage.floor
    for k, (name, color, _) in enumerate(series):
        x = np.arange(len(names)) - 0.4 + (k + 0.5) * width
        values = 1e3 * group[name]
        bars = each.bar(x, np.nan_to_num(values), width, color=color)
        for bar in np.array(bars.patches)[~counts]:
            bar.set(alpha=0.25)
        values = values[counts]
        if np.isfinite(values).any():
            all_.bar(k, float(np.sqrt(np.nanmean(values**2))), 0.7, color=color)
            # A fall or two decide the root mean square.
            all_.plot(k, float(np.nanmedian(values)), "_", color="#111111", ms=12, mew=2)
    for axes in (each, all_):
        axes.axhline(1e3 * floor, color="#111111", lw=1, ls=":")
    if aside:
        each.set_title("pale: set aside, as in the floor", fontsize=9)
    turned = sum(map(len, names)) > LABELS
    each.set_xticks(
        range(len(names)), names, rotation=45 if turned else 0, ha="right" if turned else "center", fontsize=8
    )
    each.set_ylabel(f"{HELD_OUT} of the caps\nat the key frame [mm]")
    all_.set_xticks(range(len(series)), [_SHORT[name] for name, _, _ in series], rotation=45, ha="right", fontsize=8)
    all_.set_title("all together:\nroot mean square", fontsize=9)
    # Not the bars' own marks: those of a first interval that is set aside are pale.
    handles: list[Any] = [Patch(color=color) for _, color, _ in series]
    handles += [
        Line2D([], [], color="#111111", lw=1, ls=":"),
        Line2D([], [], color="#111111", ls="", marker="_", ms=12, mew=2),
    ]
    labels = [*(label for _, _, label in series), FLOOR, "median of all together"]
    _legend(figure, handles, labels)
    return png_bytes(figure)
