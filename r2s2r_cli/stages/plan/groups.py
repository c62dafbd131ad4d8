"""A plan as the groups of its artifact (schemas/plan.py) and as its report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.plan.goal import Goal
from r2s2r_cli.stages.plan.long import Walk
from r2s2r_cli.stages.plan.placement import Reference
from r2s2r_cli.stages.plan.rewards import Outcomes
from r2s2r_cli.stages.plan.robust import Primitive, together
from r2s2r_cli.stages.plan.route import Paths, farthest, walked
from schemas.results_plan import GaitFigures, PolicyFigures


@dataclass(frozen=True)
class LongPolicy:
    """A long policy and what came of it. path: on paper; came, good: over drawn numbers and start poses."""

    name: str
    walk: Walk
    path: Paths
    came: Outcomes
    good: np.ndarray
    goal: Goal | None

    @property
    def expected(self) -> np.ndarray:
        """x, y [m] and turn [rad] on paper, (3,)."""
        return np.append(self.path.xy[0, -1], self.path.heading[0, -1])

    @property
    def far(self) -> float:
        """How far it comes from its start [m], at the ends of its gaits, with the best numbers."""
        return float(farthest(walked(self.walk.way))[0])

    @property
    def reached(self) -> np.ndarray:
        """x, y [m] and turn [rad] of every draw that worked, or of all where none did, (B, 3): turns round the one that
        they lie about, which has as many whole turns as on paper."""
        rows = np.flatnonzero(self.good) if self.good.any() else np.arange(len(self.good))
        moves = together(np.column_stack([self.came.com[rows, :2], self.came.turn[rows]]))
        moves[:, 2] += 2 * np.pi * np.round((self.expected[2] - moves[:, 2].mean()) / (2 * np.pi))
        return moves

    def back_again(self) -> str:
        """What is to be said where it is to go far, of several gaits, and ends nearer to its start than half of what
        one of them goes on paper; else empty."""
        legs = np.linalg.norm(np.diff(self.path.xy[0], axis=0), axis=-1)
        far = float(np.median(np.linalg.norm(self.reached[:, :2], axis=1)))
        if self.name != "straight" or len(legs) < 2 or not far < 0.5 * float(legs.max()):
            return ""
        return (
            f"simulated whole, it ends {far:.2f} m from its start, and one of its {len(legs)} gaits goes "
            f"{legs.max():.2f} m on paper: they undo each other, or do nothing; more of plan.cycles, plan.depth or "
            "plan.beam leave more to choose from"
        )

    def off_goal(self) -> str:
        """How far it ends from its goal, and what is near enough, where it is not: simulated, else on paper. Empty
        where both are near enough, and without a goal."""
        goal = self.goal
        for how, end in (("simulated whole", self.reached.mean(axis=0)), ("on paper", self.expected)):
            if goal is not None and not goal.reached(end[:2], end[2]):
                far, turn = goal.left(end[:2], end[2])
                return (
                    f"{how}, it ends {far:.2f} m and {np.degrees(turn):.0f} deg from the goal; near enough are "
                    f"{goal.within_m:g} m (plan.goal_within_m) and {np.degrees(goal.within_rad):.0f} deg"
                )
        return ""


def symmetry_groups(reference: Reference) -> dict[str, Group]:
    """Groups `symmetry` and `reference`."""
    elements = reference.group.elements

    def table(name: str) -> np.ndarray:
        return np.array([getattr(element, name) for element in elements], dtype=np.int64)

    symmetry = Group({
        "caps": table("caps"), "cables": table("cables"), "motors": table("motors"),
        "turn": np.array([element.turn for element in elements]),
        "misfit": np.array([element.misfit_m for element in elements]),
        "support": np.array(reference.group.supports(reference.support), dtype=np.int64),
    })  # fmt: skip
    return {"symmetry": symmetry, "reference": Group({"p": reference.p})}


def primitives_group(primitives: Sequence[Primitive]) -> Group:
    """Group `primitives`."""

    def of(name: str) -> np.ndarray:
        return np.array([getattr(one, name) for one in primitives], dtype=float)

    move, sd = np.array([one.move for one in primitives]), np.array([one.move_sd for one in primitives])
    return Group({
        "name": _text([one.name for one in primitives]), "behaviour": _text([one.behaviour for one in primitives]),
        "nominal": of("nominal"), "mean": of("mean"), "sd": of("sd"), "score": of("score"), "worked": of("worked"),
        "shift": move[:, :2], "shift_sd": sd[:, :2], "turn": move[:, 2], "turn_sd": sd[:, 2],
        "element": np.array([one.element for one in primitives], dtype=np.int64),
        "same_element": of("same_element"), "duration": of("duration"),
    })  # fmt: skip


def long_group(policies: Sequence[LongPolicy]) -> Group:
    """Group `long`."""
    goals = [[np.nan] * 3 if one.goal is None else [*one.goal.xy, one.goal.heading] for one in policies]
    return Group({
        "name": _text([one.name for one in policies]),
        "gaits": _text([" ".join(one.walk.gaits) for one in policies]),
        "shortcuts": np.array([one.walk.shortcuts for one in policies], dtype=np.int64),
        "saved": np.array([one.walk.saved for one in policies], dtype=np.int64),
        "expected": np.array([one.expected for one in policies]),
        "mean": np.array([one.reached.mean(axis=0) for one in policies]),
        "sd": np.array([one.reached.std(axis=0) for one in policies]),
        "worked": np.array([one.good.mean() for one in policies]),
        "duration": np.array([one.came.duration.mean() for one in policies]),
        "goal": np.array(goals, dtype=float),
    })  # fmt: skip


def gait_figures(one: Primitive) -> GaitFigures:
    """A gait for the report."""
    return GaitFigures(
        name=one.name, behaviour=one.behaviour, shapes=one.gait.key, nominal=one.nominal, mean=one.mean, sd=one.sd,
        score=one.score, worked=one.worked, shift_m=(float(one.move[0]), float(one.move[1])),
        turn_rad=float(one.move[2]), duration_s=one.duration,
    )  # fmt: skip


def policy_figures(one: LongPolicy) -> PolicyFigures:
    """A long policy for the report."""
    expected, mean, sd = one.expected, one.reached.mean(axis=0), one.reached.std(axis=0)
    return PolicyFigures(
        name=one.name, gaits=tuple(one.walk.gaits), targets=len(one.walk.policy), shortcuts=one.walk.shortcuts,
        saved=one.walk.saved, expected_m=(float(expected[0]), float(expected[1])), expected_turn_rad=float(expected[2]),
        shift_m=(float(mean[0]), float(mean[1])), shift_sd_m=(float(sd[0]), float(sd[1])), turn_rad=float(mean[2]),
        turn_sd_rad=float(sd[2]), worked=float(one.good.mean()), duration_s=float(one.came.duration.mean()),
        goal=None if one.goal is None else (*one.goal.xy, one.goal.heading),
    )  # fmt: skip


def _text(words: Sequence[str]) -> np.ndarray:
    return np.char.encode(np.array(words, dtype=str), "utf-8")
