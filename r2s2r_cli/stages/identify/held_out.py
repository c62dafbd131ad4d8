"""Train and test intervals predicted by us, by rivals, fitted or not, and by the baselines; beside the floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.closed_free_run import closed_free_run
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.found import OURS, REPEATS, FreeRunFound, SegmentFound
from r2s2r_cli.stages.identify.free import Mapping as FreeMapping, select
from r2s2r_cli.stages.identify.judged import Replayed, replayed, starts_of, steps_from
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import PAPER_FREE, Recipe
from r2s2r_cli.stages.identify.repeating import Repeats, repeats_from
from r2s2r_cli.stages.identify.replays import free_runs_found, segments_found
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.measures.floor import Floor, floor_of
from r2s2r_cli.stages.measures.keyframes import free_run
from r2s2r_cli.stages.measures.replay import observed_run
from r2s2r_cli.stages.measures.steps import chains
from r2s2r_cli.stages.measures.table import Predicted, Row, baselines_of, judge
from schemas.robot import Robot

NOMINAL = "nominal"
TWO_PARAMETERS = "refit of two parameters"
ROUNDS = 4
"""Parts of the work that progress counts."""


@dataclass(frozen=True)
class Judged:
    """Rows of predictors over train and test segments, and what they rest on. p_RS: attachment points (cable, 2, 3)."""

    train_segments: tuple[SegmentFound, ...]
    train: Mapping[str, Row]
    test_segments: tuple[SegmentFound, ...]
    test: Mapping[str, Row] | None
    floor: Floor | None
    free_runs: tuple[FreeRunFound, ...]
    closed_loop_m: float | None
    p_RS: np.ndarray
    rollouts: int
    warnings: tuple[str, ...]
    repeats: Repeats | None = None


def held_out(
    robot: Robot,
    runs: Sequence[RunData],
    request: Request,
    predictor: Predictor,
    values: np.ndarray,
    recipe: Recipe,
    *,
    cache_dir: Path | None,
    progress: Callable[[int, int], None],
) -> Judged:
    """Judge the values. Nothing is fitted to test intervals; the rivals are fitted to the same training intervals."""
    ours_train, ours_test = _both(runs, request, predictor, values, recipe)
    progress(1, ROUNDS)
    rivals, rollouts, warnings = _rivals(robot, runs, request, recipe, predictor, cache_dir, progress)
    test, smoothed = None, steps_from(runs, request.train, smoothed=True)
    wanted = request.discrepancy and request.method != "paper"
    repeats = repeats_from(ours_train, smoothed, ours_test) if wanted else None
    if ours_test.steps:
        table = {OURS: ours_test.predicted}
        if repeats is not None and repeats.made is not None:
            table[REPEATS] = repeats.made.predicted
        table.update({name: one[1] for name, one in rivals.items()})
        table.update(baselines_of(ours_test.steps, smoothed))
        test = judge(ours_test.steps, table)
    train = judge(ours_train.steps, {OURS: ours_train.predicted, **{name: one[0] for name, one in rivals.items()}})
    loop = None
    closed: tuple[np.ndarray, ...] = ()
    if ours_test.steps:
        closed, said = closed_free_run(runs, ours_test.steps, predictor, values, recipe, request.train)
        warnings += said
        if closed:
            observed = [observed_run(chain)[1] for chain in chains(ours_test.steps)]
            loop = free_run(np.concatenate(observed), np.concatenate(closed))
    progress(ROUNDS, ROUNDS)
    return Judged(
        train_segments=segments_found(ours_train), train=train, test_segments=segments_found(ours_test), test=test,
        floor=_floor(runs, request), free_runs=free_runs_found(ours_test, closed, repeats), closed_loop_m=loop,
        p_RS=sites(predictor, values), rollouts=rollouts, warnings=tuple(warnings),
        repeats=repeats,
    )  # fmt: skip


def _rivals(
    robot: Robot, runs: Sequence[RunData], request: Request, recipe: Recipe, predictor: Predictor,
    cache_dir: Path | None, progress: Callable[[int, int], None],
) -> tuple[dict[str, tuple[Predicted, Predicted]], int, list[str]]:  # fmt: skip
    """Robot.toml's own numbers, and the paper's two parameters fitted with the same machinery: (train, test) each; how
    many windows that simulated, and what went wrong."""
    found: dict[str, tuple[Predicted, Predicted]] = {}
    warnings: list[str] = []
    count = 0
    for number, (name, names) in enumerate(((NOMINAL, ()), (TWO_PARAMETERS, PAPER_FREE))):
        try:
            frees = select(names, robot) if names else ()
            mapping = FreeMapping(robot, frees, structure=replace(predictor.structure, effects=()))
            own = Predictor(mapping, step=recipe.step, cache_dir=cache_dir)
            if own.structure == predictor.structure:
                own.simulator = predictor.simulator  # its machine code
            at = np.array([free.start for free in frees])
            if names:
                at = fit(runs, request.train, own, recipe, seed=request.seed).values
            train, test = _both(runs, request, own, at, recipe)
            found[name] = train.predicted, test.predicted
            count += own.rollouts
        except NumericalError as error:
            warnings.append(f"the rival '{name}' could not be simulated: {error.what}")
        progress(2 + number, ROUNDS)
    return found, count, warnings


def _both(
    runs: Sequence[RunData], request: Request, predictor: Predictor, values: np.ndarray, recipe: Recipe
) -> tuple[Replayed, Replayed]:
    """Train and test intervals replayed, these also in free runs, from one pass of the filter."""
    starts = starts_of(runs, (*request.train, *request.test), predictor, values, recipe)
    return (
        replayed(runs, request.train, predictor, values, recipe, free_run=False, starts=starts),
        replayed(runs, request.test, predictor, values, recipe, starts=starts),
    )


def _floor(runs: Sequence[RunData], request: Request) -> Floor | None:
    """From repeats among the training intervals; with too few of them, from all that the request names."""
    own = floor_of(steps_from(runs, request.train))
    if own is not None and own.interval is not None:
        return own
    return floor_of(steps_from(runs, (*request.train, *request.test))) or own


def sites(predictor: Predictor, values: np.ndarray) -> np.ndarray:
    """Attachment points p_RS of every cable [m], (cable, 2, 3), with the identified numbers."""
    from r2s2r_cli.stages.identify.free import with_values

    named = {**predictor.mapping.fixed, **dict(zip(predictor.mapping.names, map(float, values), strict=True))}
    robot, _ = with_values(predictor.mapping.robot, named)
    return np.array([cable.sites_m for cable in robot.cables])
