"""Which intervals are trained on and tested: what is read, what is left over, what is refused."""

from __future__ import annotations

import shlex
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.commands.identify_hints import completed, options_of, typed_options
from r2s2r_cli.errors import ExitCode, InputError, UsageError
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.selection import complete, default_split, in_words, parse_selection, split, upright
from tests.stages.identify.replayed import threebar, walk
from tests.stages.measures.gait import run

CRAWL, TURN = run(11, name="crawl"), run(4, name="turn")
TURN.intervals.complete[3] = False
RUNS = [CRAWL, TURN]


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["crawl:1-7"], {"crawl": (1, 2, 3, 4, 5, 6, 7)}),
        (["crawl:1,3,5-7"], {"crawl": (1, 3, 5, 6, 7)}),
        (["crawl:7,2,2"], {"crawl": (2, 7)}),
        (["crawl:1-2", "crawl:2-3", "turn:1"], {"crawl": (1, 2, 3), "turn": (1,)}),
        (["turn"], {"turn": (1, 2, 3)}),
        ([], {}),
    ],
)
def test_selections_are_read(texts: list[str], expected: dict[str, tuple[int, ...]]) -> None:
    """Spans, lists and both; a run without numbers is all its complete intervals; texts of one run add up."""
    assert parse_selection(texts, RUNS) == tuple(Selection(name, chosen) for name, chosen in expected.items())


@pytest.mark.parametrize(
    ("text", "expected", "received", "hint"),
    [
        ("crawk:1-7", "crawl | turn", "crawk", "--test crawl:1-7"),
        (":1-7", "crawl | turn", ":1-7", None),
        ("crawl:", "RUN:1-7 or RUN:1,3,5-7, of crawl:1-11", "crawl:", "--test crawl:1-11"),
        ("crawl:1-", "RUN:1-7 or RUN:1,3,5-7, of crawl:1-11", "crawl:1-", "--test crawl:1-11"),
        ("crawl:7-1", "RUN:1-7 or RUN:1,3,5-7, of crawl:1-11", "crawl:7-1", "--test crawl:1-11"),
        ("crawl:10-40", "crawl:1-11", "crawl:12", "--test crawl:10-11"),
        ("crawl:1-99999999999", "crawl:1-11", "crawl:12", "--test crawl:1-11"),
        ("crawl:0", "crawl:1-11", "crawl:0", "--test crawl:1-11"),
        ("turn:4", "turn:1-3", "turn:4", "--test turn:1-3"),
    ],
)
def test_what_does_not_exist_is_a_usage_error(text: str, expected: str, received: str, hint: str | None) -> None:
    """Unknown run, empty, backward or unreadable span, beyond the run, not complete: exit 2, valid range, a hint."""
    with pytest.raises(UsageError) as error:
        parse_selection([text], RUNS, "--test")
    assert error.value.exit_code == ExitCode.USAGE
    assert (error.value.where, error.value.expected, error.value.received) == ("--test", expected, received)
    assert hint is None or error.value.hint == hint


def test_the_default_trains_on_the_first_two_thirds() -> None:
    """7 of 11 and 2 of 3; one of two; a run of one interval is trained on and not tested."""
    assert default_split(CRAWL) == (Selection("crawl", tuple(range(1, 8))), Selection("crawl", (8, 9, 10, 11)))
    assert default_split(TURN) == (Selection("turn", (1, 2)), Selection("turn", (3,)))
    assert default_split(run(2)) == (Selection("walk", (1,)), Selection("walk", (2,)))
    assert default_split(run(1)) == (Selection("walk", (1,)), Selection("walk", ()))
    assert default_split(run(2), 0.99)[1].intervals == (2,)


def test_the_side_that_is_not_named_is_the_rest() -> None:
    """Without --train all that is not tested, of every run; without --test the rest of the runs that are trained on."""
    train, test = split(RUNS, [], ["crawl:8-11"])
    assert train == (Selection("crawl", tuple(range(1, 8))), Selection("turn", (1, 2, 3)))
    assert test == (Selection("crawl", (8, 9, 10, 11)),)
    train, test = split(RUNS, ["crawl:5-11"], [])
    assert (train, test) == ((Selection("crawl", tuple(range(5, 12))),), (Selection("crawl", (1, 2, 3, 4)),))
    assert split(RUNS, ["crawl"], []) == ((Selection("crawl", complete(CRAWL)),), ())
    assert split(RUNS, ["turn:1"], ["crawl:2"]) == ((Selection("turn", (1,)),), (Selection("crawl", (2,)),))
    assert split([CRAWL], [], []) == tuple((one,) for one in default_split(CRAWL))


def test_an_interval_on_both_sides_is_a_usage_error() -> None:
    """5 to 7 twice: the hint trains on what is left."""
    with pytest.raises(UsageError, match="trained on and tested") as error:
        split(RUNS, ["crawl:1-7"], ["crawl:5-9"])
    assert error.value.received == "crawl:5-7"
    assert error.value.hint == "--train crawl:1-4 --test crawl:5-9"
    with pytest.raises(UsageError, match="trained on and tested") as error:
        split(RUNS, ["crawl"], ["crawl"])
    assert error.value.hint == "--train crawl:1-7 --test crawl:8-11"


@pytest.mark.parametrize(
    ("train", "test", "hint"),
    [
        ("crawl:1-7", "crawl:8-20", "--test crawl:8-11"),
        ("crawl:1-7", "crawl:12", "--test crawl:8-11"),
        ("crawl:1-20", "crawl:8-11", "--train crawl:1-7"),
        ("crawl:12", "crawl:8-11", "--train crawl:1-7"),
        ("crawl:1-7", "crawl", "--train crawl:1-7 --test crawl:8-11"),
        ("crawl:1-5", "crawl:1-5", "--train crawl:1-5 --test crawl:6-11"),
        ("crawl", "crawl:12", "--train crawl:1-7 --test crawl:8-11"),
    ],
)
def test_the_hint_leaves_the_other_side_its_intervals(train: str, test: str, hint: str) -> None:
    """What it says is accepted with the other option as it was: no hint leads to the next one."""
    with pytest.raises(UsageError) as error:
        split(RUNS, [train], [test])
    assert error.value.hint == hint
    sides = {"--train": train, "--test": test}
    words = hint.split()
    sides.update(zip(words[::2], words[1::2], strict=True))
    trained, tested = split(RUNS, [sides["--train"]], [sides["--test"]])
    assert trained and tested


@pytest.mark.parametrize(
    ("train", "test", "hint", "where"),
    [
        (["crawk:1-7"], ["crawk:8-11"], "--train crawl:1-7 --test crawl:8-11", "--train, --test"),
        (["crawk:1-7"], ["tunr:1"], "--train crawl:1-7 --test turn:1", "--train, --test"),
        (["crawk"], ["crawk"], "--train crawl:1-7 --test crawl:8-11", "--train, --test"),
        (["crawk:1-7"], ["crawl:5-9"], "--train crawl:1-4", "--train"),
        (["crawl:1-99"], ["turn:9"], "--train crawl:1-11 --test turn:1-3", "--train, --test"),
        (["crawl", "turn"], ["crawl:1-2", "turn:1"], "--train crawl:3-11 --train turn:2-3", "--train"),
        (["crawk:1-2", "crawk:4", "tunr:1"], ["crawl:8"],
         "--train crawl:1-2 --train crawl:4 --train turn:1", "--train"),
        ([":1-3"], [":4"], "--train turn:1-2 --test turn:3", "--train, --test"),
    ],
)  # fmt: skip
def test_a_hint_mends_all_that_is_wrong(train: list[str], test: list[str], hint: str, where: str) -> None:
    """Runs that do not exist, intervals that do not, those on both sides, of both options and of every run: the command
    of the hint is accepted, whatever of it was typed wrong."""
    with pytest.raises(UsageError) as error:
        split(RUNS, train, test)
    assert (error.value.hint, error.value.where) == (hint, where)
    words = typed_options(train=train, test=test)
    asked = options_of(shlex.split(completed(error.value, words))[2:])
    sides = [[text for name, text in asked if name == option and text] for option in ("--train", "--test")]
    trained, tested = split(RUNS, *sides)
    assert trained and tested


def test_a_hint_keeps_all_texts_of_its_run() -> None:
    """Two texts of one run, the second too long: what exists of both stays asked for."""
    with pytest.raises(UsageError) as error:
        split(RUNS, ["crawl:1-3", "crawl:9-20"], ["turn:1"])
    assert error.value.hint == "--train crawl:1-3,9-11"


def test_nothing_to_train_on_is_a_usage_error_and_too_little_data_bad_input() -> None:
    """All tested: exit 2. One interval in all: exit 4."""
    with pytest.raises(UsageError, match="nothing is left") as usage:
        split([CRAWL], [], ["crawl"])
    assert usage.value.hint == "--test crawl:11"
    with pytest.raises(InputError) as bad:
        split([run(1)], [], [])
    assert bad.value.exit_code == ExitCode.INPUT


def test_numbers_in_words_are_read_back() -> None:
    """`1-3,5,7-8` of six numbers, and back."""
    assert in_words((1, 2, 3, 5, 7, 8)) == "1-3,5,7-8"
    assert parse_selection([f"crawl:{in_words((1, 2, 3, 5, 7, 8))}"], RUNS)[0].intervals == (1, 2, 3, 5, 7, 8)
    assert in_words(()) == ""


def test_a_robot_that_fell_before_its_policy_teaches_nothing() -> None:
    """A run that opens at rest counts where every cable is as long as at rest, to what sensors and controller leave; of
    a heap of rods it is said what is wrong; where all lie, robot.toml's rest is wrong; where the opening is no rest,
    nothing is asked."""
    robot = threebar()
    good = walk()
    target = good.intervals.target.copy()
    target[0] = 1.0
    p_WE = good.p_WE.copy()
    p_WE[:] = np.array(robot.rest_caps_m)
    stands = replace(good, name="stands", p_WE=p_WE, intervals=replace(good.intervals, target=target))
    flat = replace(stands, name="flat", p_WE=p_WE * [1.6, 1.0, 0.1])
    kept, said = upright([flat, stands], robot)
    assert [run.name for run in kept] == ["stands"]
    assert len(said) == 1 and said[0].startswith("run flat ") and "--train flat" in said[0] and "at rest" in said[0]
    assert upright([flat], robot) == ([flat], ())
    moving = replace(flat, intervals=good.intervals)
    assert upright([stands, moving], robot) == ([stands, moving], ())
    near = replace(stands, p_WE=p_WE * 1.05)
    assert upright([near, stands], robot) == ([near, stands], ())
