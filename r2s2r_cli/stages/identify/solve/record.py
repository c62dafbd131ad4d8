"""What a solver tells while it works and when it is done: progress, checkpoints, solutions."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

NEAR_BOUND = 0.01
"""Share of its range within which an unknown counts as on its bound."""


class Reason(StrEnum):
    """Why an iteration ended; `sentence` says it to people."""

    COST = "cost"
    STEP = "step"
    GRADIENT = "gradient"
    STUCK = "stuck"
    ITERATIONS = "iterations"
    COOLED = "cooled"

    @property
    def sentence(self) -> str:
        """One sentence."""
        return _SENTENCES[self]

    @property
    def converged(self) -> bool:
        """True where more iterations would not change the answer."""
        return self in (Reason.COST, Reason.STEP, Reason.GRADIENT, Reason.COOLED)


_SENTENCES = {
    Reason.COST: "Converged: the last step lowered the cost by less than the tolerance.",
    Reason.STEP: "Converged: two steps in a row were far smaller than the standard deviations of the unknowns.",
    Reason.GRADIENT: "Converged: the gradient leaves no step worth a share of a standard deviation.",
    Reason.STUCK: "Stopped: no step along the derivatives lowers the cost, which has a kink or is rough here.",
    Reason.ITERATIONS: "Stopped: the number of iterations allowed is used up.",
    Reason.COOLED: "Converged: candidates drawn as wide as the standard deviations lower the cost no further.",
}


@dataclass(frozen=True)
class Counts:
    """Evaluations of a problem: with residuals only, and with the Jacobian as well (which costs several times more)."""

    plain: int = 0
    jacobian: int = 0


@dataclass(frozen=True)
class Progress:
    """Where a fit is, after an iteration: start of starts, stage of stages, iteration of at most max_iterations.

    cost: robust, priors included. step_sd: length of the step in standard deviations of the unknowns.
    """

    iteration: int
    max_iterations: int
    cost: float
    damping: float
    step_sd: float
    counts: Counts
    stage: int = 0
    stages: int = 1
    stage_name: str = ""
    start: int = 0
    starts: int = 1

    @property
    def fraction(self) -> float:
        """Share of the iterations allowed that are over: a lower bound of the share done."""
        inner = self.iteration / max(self.max_iterations, 1)
        return (self.start + (self.stage + inner) / self.stages) / self.starts


@dataclass(frozen=True)
class State:
    """All that Levenberg-Marquardt carries from one iteration to the next; the evaluation at z is made again."""

    z: tuple[float, ...]
    damping: float
    growth: float = 2.0
    iteration: int = 0
    small_steps: int = 0
    costs: tuple[float, ...] = ()
    counts: Counts = Counts()
    reason: Reason | None = None
    idle_steps: int = 0


@dataclass(frozen=True)
class Checkpoint:
    """Where to go on: the state of the running stage of the running start, and what is finished.

    entered: the unknowns at the beginning of the stage. dropped: names of stages that made the next one's fit worse.
    spent: evaluations of the stages before. finished: the last checkpoints of the starts before, None where one failed.
    seed: of the draw of the starts.
    """

    state: State
    stage: int = 0
    entered: tuple[float, ...] = ()
    dropped: tuple[str, ...] = ()
    spent: Counts = Counts()
    start: int = 0
    finished: tuple[Checkpoint | None, ...] = ()
    seed: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON values; floats keep every bit in Python's JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, payload: dict[str, Any]) -> Checkpoint:
        """The inverse of `to_dict`, also after a round through JSON. Raises KeyError or TypeError for another shape."""
        state = dict(payload["state"])
        state["counts"] = Counts(**state["counts"])
        state["reason"] = Reason(state["reason"]) if state["reason"] else None
        state["z"], state["costs"] = tuple(state["z"]), tuple(state["costs"])
        rest = {name: value for name, value in payload.items() if name != "state"}
        rest["spent"] = Counts(**rest["spent"])
        rest["entered"], rest["dropped"] = tuple(rest["entered"]), tuple(rest["dropped"])
        rest["finished"] = tuple(one and cls.from_dict(one) for one in rest["finished"])
        return cls(state=State(**state), **rest)


@dataclass(frozen=True)
class Solution:
    """A minimum, and what statistics need there. n unknowns, m residuals.

    z: (n,). cost: sum of rho / 2 plus priors. costs: at the start and after each iteration (of the last stage).
    residual: (m,), whitened, not weighted. jacobian: (m, n). weight: (m,), of the robust loss. normal_data: J^T W J;
    normal: with the priors, both (n, n). gradient: (n,), of the cost. on_bound: parameters on their box or within 1 %
    of its width of it. dropped: early horizons that were not used.
    """

    z: np.ndarray
    cost: float
    costs: tuple[float, ...]
    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray
    normal_data: np.ndarray
    normal: np.ndarray
    gradient: np.ndarray
    reason: Reason
    iterations: int
    counts: Counts
    on_bound: tuple[str, ...]
    dropped: tuple[str, ...] = ()

    @property
    def message(self) -> str:
        """Why it ended, one sentence."""
        return self.reason.sentence


def names_on_bound(z: np.ndarray, lower: np.ndarray, upper: np.ndarray, names: tuple[str, ...]) -> tuple[str, ...]:
    """Parameters on their box or, where both bounds are finite, within 1 % of its width of one."""
    found = []
    for name, value, low, high in zip(names, z, lower, upper, strict=False):
        width = high - low
        margin = NEAR_BOUND * width if np.isfinite(width) else 0.0
        if value <= low + margin or value >= high - margin:
            found.append(name)
    return tuple(found)
