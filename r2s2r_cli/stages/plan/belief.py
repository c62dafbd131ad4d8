"""What the planner believes about the simulator's numbers: values with their uncertainty, and draws from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages import identified as found
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.identify.free.mapping import Mapping
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData

UNIDENTIFIED = ("motor_speed", "friction", "rest_length", "stiffness_passive")
"""What varies where nothing was identified: the paper's two numbers, and the passive tendons."""


@dataclass(frozen=True)
class Belief:
    """Numbers of the simulator. model: values and their covariance; identified: whether runs told them."""

    model: found.Identified
    identified: bool
    doubt: float = 0.0
    """Least standard deviation of drawn numbers, as a share of that of their priors: what an identification states is
    what noise leaves open, and a simulator errs by more than that."""

    @property
    def words(self) -> str:
        """Where they come from."""
        return self.model.words

    def draws(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Values (count, n): the first is the best one, the others are drawn; each within its bounds."""
        prior = np.array([free.prior_sd for free in self.model.mapping.frees])
        known = np.diag(self.model.covariance)
        told = np.isfinite(prior) & np.isfinite(known)
        least = np.zeros(len(prior))
        least[told] = (self.doubt * prior[told]) ** 2 - known[told]
        more = np.diag(np.maximum(least, 0.0))
        model = replace(self.model, covariance=self.model.covariance + more)
        return model.draws(count, int(generator.integers(2**31)))


def assumed(robot: Robot) -> Belief:
    """Numbers of robot.toml; what varies does so as the priors of `identify` say."""
    known = entries(robot)
    frees = tuple(known[name].free for name in UNIDENTIFIED if name in known)
    variance = [free.prior_sd**2 if np.isfinite(free.prior_sd) else 0.0 for free in frees]
    names = ", ".join(free.name for free in frees)
    words = f"robot.toml, nothing identified; priors of {names}"
    values = np.array([free.start for free in frees])
    return Belief(found.Identified(words, robot, Mapping(robot, frees), values, np.diag(variance)), False)


def identified(robot: Robot, data: ArtifactData, where: str) -> Belief:
    """What an identification found. where: its path, for messages. Raises InputError for one of another robot, or with
    parameters that this robot does not have."""
    return Belief(found.identified(data, robot, words=where), True)
