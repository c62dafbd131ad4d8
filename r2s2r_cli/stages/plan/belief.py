"""What the planner believes about the simulator's numbers: values with their uncertainty, and draws from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.free.base import Free, values_of
from r2s2r_cli.stages.identify.free.catalogue import entries
from schemas.robot import Robot

UNIDENTIFIED = ("motor_speed", "friction", "rest_length", "stiffness_passive")
"""What varies where nothing was identified: the paper's two numbers, and the passive tendons."""
FIXED = 4
"""Code of `parameters/trust` for a number that was given, not fitted."""


@dataclass(frozen=True)
class Belief:
    """Numbers of the simulator. frees: those that vary, started at their value; covariance: of their coordinates z,
    (n, n). fixed: given values by name. effects: ids in the simulator. words: where this comes from."""

    frees: tuple[Free, ...]
    covariance: np.ndarray
    fixed: dict[str, float]
    effects: tuple[str, ...]
    identified: bool
    words: str

    def draws(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Values (count, n): the first is the best one, the others are drawn; each within its bounds."""
        z0 = np.array([free.to_z(free.start) for free in self.frees])
        size, turn = np.linalg.eigh(self.covariance) if len(z0) else (np.zeros(0), np.zeros((0, 0)))
        spread = turn * np.sqrt(np.maximum(size, 0.0))
        z = z0 + generator.standard_normal((count, len(z0))) @ spread.T
        z[:1] = z0
        bounds = np.array([free.bounds_z() for free in self.frees]).reshape(-1, 2)
        z = np.clip(z, bounds[:, 0], bounds[:, 1])
        return np.array([values_of(self.frees, one) for one in z]).reshape(count, len(z0))


def assumed(robot: Robot) -> Belief:
    """Numbers of robot.toml; what varies does so as the priors of `identify` say."""
    known = entries(robot)
    frees = tuple(known[name].free for name in UNIDENTIFIED if name in known)
    variance = [free.prior_sd**2 if np.isfinite(free.prior_sd) else 0.0 for free in frees]
    names = ", ".join(free.name for free in frees)
    return Belief(frees, np.diag(variance), {}, (), False, f"robot.toml, nothing identified; priors of {names}")


def identified(robot: Robot, data: ArtifactData, where: str) -> Belief:
    """What an identification found. where: its path, for messages.

    A number that the runs do not determine varies as its prior says. Raises InputError for an identification of
    another robot, or with parameters that this version does not know.
    """
    facts, table = data.groups["fit"].attributes, data.groups["parameters"]
    if facts["robot"] != robot.name:
        raise InputError(
            "the identified parameters are those of another robot", where=f"{where}: fit/robot",
            expected=robot.name, received=str(facts["robot"]), hint="r2s2r identify --force",
        )  # fmt: skip
    names = [name.decode() for name in table["name"]]
    known = entries(robot)
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(
            "the identification has parameters that this robot or version does not have",
            where=f"{where}: parameters/name", expected="names that docs/reference/free-parameters.md lists",
            received=", ".join(missing), hint="r2s2r identify --force",
        )  # fmt: skip
    free_rows = [k for k in range(len(names)) if int(table["trust"][k]) != FIXED]
    fixed = {names[k]: float(table["value"][k]) for k in range(len(names)) if k not in free_rows}
    covariance = data.groups["covariance"]["covariance"] if "covariance" in data.groups else None
    frees, unknown = [], []
    wide = np.zeros((len(free_rows), len(free_rows)))
    if covariance is not None:
        wide = np.array(covariance)[np.ix_(free_rows, free_rows)]
    for row, k in enumerate(free_rows):
        free = _as_fitted(known[names[k]].free, table["value"][k], table["bounds"][k])
        frees.append(free)
        if not np.isfinite(wide[row, row]) or covariance is None:
            prior = float(table["prior_sd"][k])
            wide[row], wide[:, row] = 0.0, 0.0
            wide[row, row] = prior**2 if np.isfinite(prior) else 0.0
            unknown.append(names[k])
    wide = np.nan_to_num(wide)
    words = f"{where}: {len(names)} identified and fixed parameters"
    if unknown:
        words += f"; by their priors: {', '.join(unknown)}"
    return Belief(tuple(frees), wide, fixed, tuple(str(facts["effects"]).split()), True, words)


def _as_fitted(free: Free, value: float, bounds: np.ndarray) -> Free:
    """The catalogue's number with the value and bounds of the fit; a value on a bound is moved just inside."""
    lower = float(bounds[0]) if np.isfinite(bounds[0]) else free.lower
    upper = float(bounds[1]) if np.isfinite(bounds[1]) else free.upper
    slack = 1e-6 * (upper - lower)
    inside = min(max(float(value), lower + slack), upper - slack)
    return replace(free, start=inside, lower=lower, upper=upper)
