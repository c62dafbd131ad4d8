"""Which target intervals are trained on and which are tested: `RUN:1-7`, `RUN:1,3,5-7`, `RUN`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest_choice
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.load import require_two_intervals
from r2s2r_cli.stages.identify.selection_hints import mended, run_of, worded
from r2s2r_cli.stages.measures.upright import fallen, not_at_rest
from schemas.config import IdentifySettings
from schemas.robot import Robot

TRAIN_SHARE: float = IdentifySettings.model_fields["train_share"].default
"""Of the complete intervals of a run, from its start, where neither side is named: the rest is tested."""

_SPANS = re.compile(r"\d+(-\d+)?(,\d+(-\d+)?)*")


def upright(runs: Sequence[RunData], robot: Robot) -> tuple[list[RunData], tuple[str, ...]]:
    """The runs in which the robot stood as at rest when its policy began, and what is to be said of each other one; all
    of them where `fallen` says none."""
    wrong = fallen({run.name: not_at_rest(run.p_WE, run.intervals, robot) for run in runs})
    said = [
        f"run {name} is neither trained on nor tested: {words}; --train {name} takes it all the same"
        for name, words in wrong.items()
    ]
    return [run for run in runs if run.name not in wrong], tuple(said)


def complete(run: RunData) -> tuple[int, ...]:
    """The complete target intervals of a run, 1-based."""
    return tuple(i + 1 for i, whole in enumerate(run.intervals.complete.tolist()) if whole)


def default_split(run: RunData, train_share: float = TRAIN_SHARE) -> tuple[Selection, Selection]:
    """The first intervals to train on, those after them to test: a robot is predicted, not interpolated.

    Both sides have one interval at least where the run has two.
    """
    have = complete(run)
    count = min(max(1, round(train_share * len(have))), max(1, len(have) - 1))
    return Selection(run.name, have[:count]), Selection(run.name, have[count:])


def split(
    runs: Sequence[RunData], train: Sequence[str], test: Sequence[str], train_share: float = TRAIN_SHARE
) -> tuple[tuple[Selection, ...], tuple[Selection, ...]]:
    """Target intervals to train on and to test on, of the texts of --train and --test.

    Without both: `default_split` of every run. Without --train: what is complete and not tested, of every run. Without
    --test: what is complete and not trained on, of the runs that are trained on; maybe nothing. Raises UsageError where
    intervals do not exist, stand on both sides, or nothing is left to train on; InputError where the runs have fewer
    than two intervals to choose from.
    """
    require_two_intervals(runs)
    if not train and not test:
        both = [default_split(run, train_share) for run in runs]
        return tuple(a for a, _ in both if a.intervals), tuple(b for _, b in both if b.intervals)
    try:
        return _sides(runs, train, test)
    except UsageError as error:
        raise mended(error, train, test, lambda first, then: _sides(runs, first, then)) from None


def _sides(
    runs: Sequence[RunData], train: Sequence[str], test: Sequence[str]
) -> tuple[tuple[Selection, ...], tuple[Selection, ...]]:
    """`split` where a side is named. Its hints mend what is met first."""
    trained = {one.run: one.intervals for one in parse_selection(train, runs, "--train", test)}
    tested = {one.run: one.intervals for one in parse_selection(test, runs, "--test", train)}
    have = {run.name: complete(run) for run in runs}
    if not train:
        trained = {name: _without(all_of, tested.get(name, ())) for name, all_of in have.items()}
    if not test:
        tested = {name: _without(have[name], chosen) for name, chosen in trained.items()}
    for run in runs:
        chosen, judged = trained.get(run.name, ()), tested.get(run.name, ())
        twice = sorted(set(chosen) & set(judged))
        if twice:
            raise UsageError(
                "an interval is trained on and tested", where="--train, --test", expected="each on one side",
                received=f"{run.name}:{in_words(twice)}", hint=_apart(run, chosen, judged),
            )  # fmt: skip
    if not any(trained.values()):
        name = max(have, key=lambda run: len(have[run]))
        raise UsageError(
            "nothing is left to train on", where="--train", expected=_all_of(runs), received="no interval",
            hint=f"--test {name}:{have[name][-1]}",
        )  # fmt: skip
    return _selections(trained), _selections(tested)


def parse_selection(
    texts: Sequence[str], runs: Sequence[RunData], option: str = "--train", other: Sequence[str] = ()
) -> tuple[Selection, ...]:
    """`crawl:1-7`, `crawl:1,3,5-7`, or `crawl` (all complete intervals); texts of one run are put together.

    other: the texts of the other side, whose intervals no hint offers a second time. Raises UsageError for a run or an
    interval that does not exist or is not complete, an empty or a backward span.
    """
    by_name = {run.name: run for run in runs}
    found: dict[str, tuple[int, ...]] = {}
    for text in texts:
        name = run_of(text)
        if name not in by_name:
            # One of the few runs there are is meant, and the other side's hint has to fit it.
            near = nearest_choice(name, by_name) if by_name else ""
            meant = [near + one[len(name) :].rstrip(":") for one in texts if run_of(one) == name] if near else []
            raise UsageError(
                "there is no such run", where=option, expected=" | ".join(by_name), received=name or text or "nothing",
                hint=" ".join(worded(option, one) for one in meant) or "r2s2r status",
            )  # fmt: skip
        run = by_name[name]
        have = complete(run)
        valid = f"{name}:{in_words(have)}" if have else "none"
        asked = _asked(text, run)
        if not asked:
            raise UsageError(
                "these are no target intervals", where=option, expected=f"RUN:1-7 or RUN:1,3,5-7, of {valid}",
                received=text, hint=_instead(option, run, texts, other),
            )  # fmt: skip
        missing = [number for number in asked if number not in have]
        if missing:
            raise UsageError(
                "an interval does not exist, or did not move to its end", where=option, expected=valid,
                received=f"{name}:{in_words(missing)}", hint=_instead(option, run, texts, other),
            )  # fmt: skip
        found[name] = tuple(sorted({*found.get(name, ()), *asked}))
    return _selections(found)


def in_words(numbers: Sequence[int]) -> str:
    """`1-3,5` of (1, 2, 3, 5)."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ",".join(f"{a}" if a == b else f"{a}-{b}" for a, b in spans)


def _numbers(spans: str, count: int) -> tuple[int, ...]:
    """The numbers of `1,3,5-7`; nothing where the text is none of these or a span runs backwards.

    A span ends one beyond the `count` intervals of the run at most, which is as wrong as a thousand.
    """
    found: list[int] = []
    for span in spans.split(",") if _SPANS.fullmatch(spans) else ():
        first, _, last = span.partition("-")
        start, end = int(first), int(last or first)
        if end < start:
            return ()
        found += range(start, max(start, min(end, count + 1)) + 1)
    return tuple(found)


def _asked(text: str, run: RunData) -> tuple[int, ...]:
    """The intervals of `run` that a text of it names, whether they exist or not; all complete ones without a span."""
    _, colon, spans = text.partition(":")
    return _numbers(spans, len(run.intervals)) if colon else complete(run)


def _of_run(texts: Sequence[str], run: RunData) -> tuple[int, ...]:
    """The complete intervals of `run` that any of the texts names."""
    named = {number for text in texts if run_of(text) == run.name for number in _asked(text, run)}
    return tuple(number for number in complete(run) if number in named)


def _instead(option: str, run: RunData, texts: Sequence[str], other: Sequence[str]) -> str:
    """What can be asked of `run` where `texts` ask for intervals that are not there: those of them that are, else every
    one, without what the other side has; both sides anew where that leaves none."""
    have, taken = complete(run), _of_run(other, run)
    free = _without(have, taken)
    left = _without(_of_run(texts, run), taken) or free
    if left:
        return f"{option} {run.name}:{in_words(left)}"
    return _both(run) if have else "r2s2r inspect 20-estimate.h5"


def _apart(run: RunData, trained: Sequence[int], tested: Sequence[int]) -> str:
    """Both sides of a run whose intervals stand on both: what is trained on gives way as far as something is left of
    it, else what is tested, else both are split anew."""
    first = _without(trained, tested) or tuple(trained)
    then = _without(tested, first) or _without(complete(run), first)
    return f"--train {run.name}:{in_words(first)} --test {run.name}:{in_words(then)}" if then else _both(run)


def _both(run: RunData) -> str:
    """Both sides of one run, split as without options."""
    first, then = (in_words(one.intervals) for one in default_split(run))
    return f"--train {run.name}:{first}" + (f" --test {run.name}:{then}" if then else "")


def _without(have: Sequence[int], taken: Sequence[int]) -> tuple[int, ...]:
    return tuple(number for number in have if number not in set(taken))


def _all_of(runs: Sequence[RunData]) -> str:
    return " | ".join(f"{run.name}:{in_words(complete(run))}" for run in runs if complete(run))


def _selections(by_run: dict[str, tuple[int, ...]]) -> tuple[Selection, ...]:
    return tuple(Selection(name, chosen) for name, chosen in by_run.items() if chosen)
