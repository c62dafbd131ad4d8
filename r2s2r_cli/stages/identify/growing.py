"""The first round's problems over growing horizons, and when derivatives may end on each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.horizon import Limits
from r2s2r_cli.stages.identify.windows import Window

EARLY_HORIZONS = Limits(max_iterations=4, tolerance=1e-2, step_sd=0.3, gradient_sd=0.1)
"""Of all horizons but the last: they only have to come near."""
BEFORE_POPULATION = Limits(max_iterations=8, tolerance=1e-3, step_sd=0.3, gradient_sd=0.1)
"""Of the last horizon that derivatives are trusted with."""
SMOOTH = 2
"""Intervals over which derivatives still tell where the minimum lies; beyond, a population does."""


def stages_of(
    predictor: Predictor, windows: Sequence[Window], recipe: Recipe
) -> tuple[list[str], list[CapResiduals], int]:
    """Problems over growing horizons with their names, and how many of them derivatives can be trusted with."""
    lengths = recipe.horizons(max(len(one.intervals) for one in windows))
    stages = [problem_of(predictor, [one.until(length) for one in windows], recipe) for length in lengths[:-1]]
    stages.append(problem_of(predictor, windows, recipe))
    names = [*(f"{length} intervals" for length in lengths[:-1]), "all"]
    return names, stages, max(1, sum(length <= SMOOTH for length in lengths))


def problem_of(
    predictor: Predictor, windows: Sequence[Window], recipe: Recipe, *, noise: float | None = None
) -> CapResiduals:
    """The problem of a recipe, or with another least noise [m]."""
    return CapResiduals(
        predictor, windows, spread=recipe.spread, noise=recipe.noise if noise is None else noise,
        key_only=recipe.key_only, held=recipe.held,
    )  # fmt: skip


def started(problem: CapResiduals, values: np.ndarray) -> np.ndarray:
    """Unknowns at these values (n,), start states not moved."""
    z: np.ndarray = problem.z0.copy()
    z[: len(problem.frees)] = [free.to_z(float(value)) for free, value in zip(problem.frees, values, strict=True)]
    return z
