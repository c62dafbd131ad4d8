"""A winch that the training intervals do not show is as the other winches are, which they do show.

Motors of one robot are bought together and run on one supply. Where five of six turn a quarter slower than robot.toml
says, leaving the sixth at full speed, because it hardly turned in training, makes every gait that does turn it bend.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.free.catalogue import catalogue
from r2s2r_cli.stages.identify.rounds import Fit

FAMILIES = ("motor_speed_in", "motor_speed_out")
"""Numbers with one for each winch, a share of what robot.toml says of that winch."""
LEAST = 2
"""Winches that are shown: from one alone nobody knows how alike they are."""
NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Others:
    """What the winches that are shown say of one that is not. value: in its unit; sd: of its coordinate; count: how
    many they are."""

    value: float
    sd: float
    count: int


def as_the_others(fitted: Fit) -> Fit:
    """The fit with the rates of winches that it held at their starts as those of the others are.

    So is their prior, which is what draws are made from. What was asked for with a start of its own keeps that. Nothing
    is fitted again: the training intervals hardly depend on these numbers, which is why they were held.
    """
    problem = fitted.problem
    own = catalogue(problem.predictor.mapping.robot)
    found = {
        k: _others(free, problem.frees, fitted.values, problem.held)
        for k, free in enumerate(problem.frees)
        if free.name in problem.held and free.start == own[free.name].start
    }
    frees, z, values = list(problem.frees), fitted.solution.z.copy(), fitted.values.copy()
    alike = {}
    for k, others in found.items():
        if others is not None:
            frees[k] = replace(frees[k], start=others.value, prior_sd=others.sd)
            values[k], z[k] = others.value, frees[k].to_z(others.value)
            alike[frees[k].name] = others.count
    if not alike:
        return fitted
    solution = replace(fitted.solution, z=z)
    return replace(fitted, problem=problem.starting(frees), solution=solution, values=values, alike=alike)


def _others(free: Free, frees: Sequence[Free], values: np.ndarray, held: Sequence[str]) -> Others | None:
    """Its start times what the others of its family turned out to be of theirs, in the median; and how far one of them
    lies from there, as a normal sd with the same 95 % as the t of so few, no wider than the prior. None where it has no
    family or where too few of that are shown."""
    family = free.name.rpartition(".")[0]
    if family not in FAMILIES:  # a payload, say, begins at none: nothing is a share of that
        return None
    ratios = [
        math.log(value / other.start)
        for other, value in zip(frees, values.tolist(), strict=True)
        if other.name.rpartition(".")[0] == family and other.name not in held
    ]
    if len(ratios) < LEAST:
        return None
    from scipy.stats import t

    count = len(ratios)
    few = float(t.ppf(0.975, count - 1)) / NORMAL_95
    sd = few * float(np.std(ratios, ddof=1)) * math.sqrt(1.0 + 1.0 / count)
    value = free.start * math.exp(float(np.median(ratios)))
    return Others(min(max(value, free.lower), free.upper), min(sd, free.prior_sd), count)
