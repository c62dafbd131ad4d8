"""Which intervals `diagnose` fits and which judge: as typed, else as the identification split them, else anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData, Group
    from r2s2r_cli.stages.diagnose.evidence import Run
    from r2s2r_cli.stages.identify.data import Selection

TRAIN, TEST = 1, 2
"""Codes of `schemas.identification.ROLES`."""


def fit_and_judge(
    runs: Sequence[Run],
    found: ArtifactData,
    train: Sequence[str] = (),
    test: Sequence[str] = (),
    *,
    healthy: Sequence[str] = (),
    say: Callable[[str], None] | None = None,
) -> tuple[tuple[Selection, ...], tuple[Selection, ...]]:
    """Intervals of the diagnosed runs that are fitted, and those that judge. found: the identification; train, test: as
    typed; healthy: names of the runs that are given as such. say: is told where the split is not that of the
    identification. Raises UsageError for what is typed and not there."""
    fit, judge = _split(runs, found, train, test)
    if fit or train or test:
        return fit, judge
    return _split_anew(runs, found, healthy, say)


def _split(
    runs: Sequence[Run], found: ArtifactData, train: Sequence[str], test: Sequence[str]
) -> tuple[tuple[Selection, ...], tuple[Selection, ...]]:
    """As typed, else that of the identification; runs that it does not know are fitted, the last of them judged."""
    from r2s2r_cli.stages.diagnose.evidence import whole
    from r2s2r_cli.stages.identify.selection import split

    caps = [run.caps for run in runs]
    if train or test:
        return split(caps, train, test)
    table = found.groups["segments"]
    fit, judge = (_selected(table, role, {run.name for run in runs}) for role in (TRAIN, TEST))
    known = _runs_of(table)
    new = [run for run in runs if run.name not in known]
    added = list(whole(new))
    if added and judge:
        fit += added
    elif added:
        fit, judge = [*fit, *added[:-1]], [added[-1]]
    return tuple(fit), tuple(judge)


def _split_anew(
    runs: Sequence[Run], found: ArtifactData, healthy: Sequence[str], say: Callable[[str], None] | None
) -> tuple[tuple[Selection, ...], tuple[Selection, ...]]:
    """The usual split, where that of the identification leaves nothing of the diagnosed runs to fit: it was made
    for other runs."""
    from r2s2r_cli.stages.identify.selection import in_words, split

    if not runs:
        return (), ()
    fit, judge = split([run.caps for run in runs], (), ())
    if say is not None:
        words = (", ".join(f"{one.run}:{in_words(one.intervals)}" for one in part) for part in (fit, judge))
        table = found.groups["segments"]
        trained = {one.run for one in _selected(table, TRAIN, _runs_of(table))}
        whom = "healthy runs alone" if trained <= {*healthy} else "none of these runs"
        said = "the identification was fitted to {}: here {} is fitted, {} judged; else say --train and --test"
        say(said.format(whom, *words))
    return fit, judge


def _runs_of(table: Group) -> set[str]:
    """Names of the runs in the table of segments of an identification."""
    return {name.decode() for name in table["run"].tolist()}


def _selected(table: Group, role: int, names: set[str]) -> list[Selection]:
    from r2s2r_cli.stages.identify.data import Selection

    found: dict[str, list[int]] = {}
    for run, interval, own in zip(
        table["run"].tolist(), table["interval"].tolist(), table["role"].tolist(), strict=True
    ):
        if own == role and run.decode() in names:
            found.setdefault(run.decode(), []).append(int(interval))
    return [Selection(run, tuple(sorted(set(numbers)))) for run, numbers in found.items()]
