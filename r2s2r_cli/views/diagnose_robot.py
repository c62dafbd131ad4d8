"""The robot of a diagnosis from above and from the side: what the verdict names is thick and in colour, else grey."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.diagnose_ranking import element_words
from r2s2r_cli.views.diagnose_words import MARKED, PLAIN, accused, commits, undecided
from r2s2r_cli.views.figure import new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from schemas.results_diagnose import DiagnoseReport, ElementFound

TEXT = "#1c2430"
ROD, CAP = "#b8bec8", "#5a6675"
"""Greys of parts that are not named: rods behind, caps dark enough for white numbers."""
TOGETHER = 0.03
"""Parts nearer to each other than this share of the picture have one label."""


def robot_picture(data: ArtifactData, report: DiagnoseReport) -> bytes:
    """PNG: rods, cables and caps, with the numbers of all of them, and what the verdict names."""
    from matplotlib.lines import Line2D

    group = data.groups["robot"]
    p = group["p_WE"] - np.array([*group["p_WE"][:, :2].mean(axis=0), 0.0])
    element = accused(report)
    figure = new_figure(9.5, 4.4)
    for axes, (i, j), title in zip(
        figure.subplots(1, 2), ((0, 1), (0, 2)), ("from above", "from the side"), strict=True
    ):
        _drawn(axes, group, p[:, [i, j]], element)
        axes.set(title=title, xlabel="x [m]", ylabel=f"{'xyz'[j]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
    figure.suptitle(named(report), color=TEXT if element is None else MARKED, fontsize=11)
    handles = [Line2D([], [], color=PLAIN, ls="-"), Line2D([], [], color=PLAIN, ls="--")]
    words = ["winched cable", "passive cable"]
    handles.append(Line2D([], [], color=ROD, lw=5))
    words.append("rod k, between caps 2k and 2k + 1")
    if element is not None and element.kind in ("cable", "motor", "sensor", "rod", "cap"):
        handles.append(Line2D([], [], color=MARKED, lw=3.5))
        words.append(f"named: {element_words(element)}")
    figure.legend(handles, words, loc="outside lower center", ncol=4, fontsize=8, frameon=False)
    return png_bytes(figure)


def named(report: DiagnoseReport) -> str:
    """The part that is named, as surely as the verdict says it; a suspect is in words alone."""
    element, channel = report.where.element, report.where.channel
    if commits(report):
        if element is None:
            return f"no single part: it acts in channel {channel}" if channel else "no part stands out"
        elsewhere = ", nothing on the robot" if element.kind in ("place", "world", "camera") else ""
        return f"named: {element_words(element)}{elsewhere}"
    if report.verdict == "no_gap":
        return "no part is accused: there is no gap above the floor (verdict: no_gap)"
    if report.verdict == "unknown":
        return "no part is accused: something is wrong that no effect explains (verdict: unknown)"
    suspect = element_words(element) or (f"channel {channel}" if channel else "")
    likeliest = f"; most suspect so far: {suspect}" if suspect and undecided(report) else ""
    return f"undecided, no part is accused{likeliest} (verdict: {report.verdict})"


def together(points: np.ndarray, distance: float) -> list[tuple[int, ...]]:
    """Indices of points (n, 2) in groups, each point with the first one that it is nearer to than `distance`."""
    groups: list[list[int]] = []
    for i, point in enumerate(points):
        near = [own for own in groups if np.hypot(*(point - points[own[0]])) < distance]
        if near:
            near[0].append(i)
        else:
            groups.append([i])
    return [tuple(own) for own in groups]


def _drawn(axes: Axes, group: Group, p: np.ndarray, element: ElementFound | None) -> None:
    near = TOGETHER * float(np.ptp(p, axis=0).max())
    ends = group["cable"]
    bad_cables = {k for k in range(len(ends)) if _is_named(element, ("cable", "sensor"), k)}
    # Motors are numbered through the winched cables alone.
    bad_cables |= {k for motor, k in enumerate(np.flatnonzero(group["actuated"]).tolist())
                   if _is_named(element, ("motor",), motor)}  # fmt: skip
    for k, (a, b) in enumerate(ends.tolist()):
        bad = k in bad_cables
        axes.plot(p[[a, b], 0], p[[a, b], 1], color=MARKED if bad else PLAIN, lw=3.5 if bad else 1.0,
                  ls="-" if group["actuated"][k] else "--", zorder=3 if bad else 1)  # fmt: skip
    middles = p[ends].mean(axis=1)
    for own, words in _labels(middles, near):
        axes.annotate(words, middles[own[0]], fontsize=7, color=MARKED if bad_cables >= set(own) else PLAIN,
                      ha="center", va="center", zorder=4,
                      bbox={"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none"})  # fmt: skip
    for rod in range(len(p) // 2):
        bad = _is_named(element, ("rod",), rod)
        caps = p[2 * rod : 2 * rod + 2]
        axes.plot(caps[:, 0], caps[:, 1], color=MARKED if bad else ROD, lw=9 if bad else 5, alpha=0.9,
                  zorder=2, solid_capstyle="round")  # fmt: skip
    for own, words in _labels(p, near):
        bad_caps = {cap for cap in own if _is_named(element, ("cap",), cap)}
        for before, cap in enumerate(own):  # one around the other where they lie on each other
            axes.plot(*p[cap], "o", ms=(19 if bad_caps else 12) + 6 * (len(own) - 1 - before),
                      color=MARKED if cap in bad_caps else CAP, mec="white", zorder=5)  # fmt: skip
        alone = len(own) == 1
        axes.annotate(words, p[own[0]], xytext=(0, 0 if alone else -17), textcoords="offset points", ha="center",
                      va="center", fontsize=8, color="white" if alone else TEXT, weight="bold", zorder=6)  # fmt: skip


def _is_named(element: ElementFound | None, kinds: tuple[str, ...], number: int) -> bool:
    return element is not None and element.kind in kinds and element.index in (None, number)


def _labels(points: np.ndarray, distance: float) -> Iterator[tuple[tuple[int, ...], str]]:
    """Numbers of parts that lie on each other, and `4, 5`."""
    for own in together(points, distance):
        yield own, ", ".join(map(str, own))
