"""The simulator as an identification left it: its numbers, how sure they are, and draws of what they may be as well.

What plans, simulates and compares takes its numbers from here, so that all of them mean the same simulator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.identify.free.mapping import Mapping
from schemas.identification import FIXED_BY_HAND

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData, Group
    from r2s2r_cli.engine import LatchedPid, Link, Parameters, Structure
    from schemas.robot import Robot

_COORDINATES = (Coordinate.LINEAR, Coordinate.LOG, Coordinate.LOGIT)
NARROW = 1e-9
"""A draw stays off its bounds by this part of their distance: on a bound a logarithm has no value."""


@dataclass(frozen=True)
class Identified:
    """One simulator. words: where its numbers come from. mapping: of its free numbers; values (n,): what they are.

    covariance (n, n): of their coordinates z; rows of NaN where the runs did not say it. bias: what the robot's
    controller reads too much of each winched cable [m], (actuated,), and command_delay: how late its commands reach the
    winches [s], both measured; None: as the numbers say.
    """

    words: str
    robot: Robot
    mapping: Mapping
    values: np.ndarray
    covariance: np.ndarray
    bias: np.ndarray | None = None
    command_delay: float | None = None

    @property
    def structure(self) -> Structure:
        """Of the engine, with the laws and effects that its numbers need."""
        return self.mapping.structure

    @property
    def theta(self) -> Parameters:
        """Of the engine, batch of 1, float64."""
        return self.mapping.theta(self.values)

    @property
    def pid(self) -> LatchedPid:
        """The low-level controller, with the errors of its sensors."""
        return self.read_by(self.mapping.pid(self.values))

    def read_by(self, pid: LatchedPid) -> LatchedPid:
        """A controller with the errors of the sensors: a cable that reads long is at position 0 where it is shorter."""
        import torch

        if self.bias is None:
            return pid
        return replace(pid, min_length=pid.min_length - torch.as_tensor(self.bias)[None])

    @property
    def link(self) -> Link | None:
        """How late commands reach the winches; None: at once."""
        from r2s2r_cli.engine import Link

        seen = self.mapping.observation(self.values).command_delay
        delay = seen if self.command_delay is None else self.command_delay
        return Link(delay) if delay > 0 else None

    @property
    def late(self) -> float:
        """How much later than it is logged a command is seen to act, in command replay [s]."""
        seen = self.mapping.observation(self.values)
        return seen.command_delay + seen.camera_delay

    def draws(self, count: int, seed: int) -> np.ndarray:
        """Values (count, n) that the runs allow as well, the first row being `values` themselves.

        Normal in z with the covariance, cut off at the bounds. A number that the runs did not say is drawn from its
        prior where it has one, and else stays.
        """
        z = np.array(
            [free.to_z(_inside(free, value)) for free, value in zip(self.mapping.frees, self.values, strict=True)]
        )
        said = np.isfinite(np.diag(self.covariance))
        deviation = np.zeros((count, len(z)))
        rng = np.random.default_rng(seed)
        if said.any():
            part = self.covariance[np.ix_(said, said)]
            size, turn = np.linalg.eigh((part + part.T) / 2)
            root = turn * np.sqrt(np.maximum(size, 0.0))
            deviation[:, said] = rng.standard_normal((count, said.sum())) @ root.T
        for k in np.flatnonzero(~said):
            free = self.mapping.frees[k]
            if math.isfinite(free.prior_sd):
                drawn = free.to_z(_inside(free, free.mean)) + free.prior_sd * rng.standard_normal(count)
                deviation[:, k] = drawn - z[k]
        deviation[0] = 0.0
        found = np.array([
            [_inside(free, free.from_z(one)) for free, one in zip(self.mapping.frees, row, strict=True)]
            for row in z + deviation
        ]).reshape(count, len(z))  # fmt: skip
        found[0] = self.values
        return found


def nominal(robot: Robot) -> Identified:
    """The simulator of robot.toml: nothing was identified, nothing is unsure. Raises InputError as `model` does."""
    return Identified("robot.toml", robot, Mapping(robot, ()), np.zeros(0), np.zeros((0, 0)))


def identified(found: ArtifactData, robot: Robot, *, words: str = "30-identify.h5") -> Identified:
    """The simulator that an identification (`30-identify.h5`) left.

    Raises InputError where it is of another robot, or names numbers that this robot does not have.
    """
    fit, table = found.groups["fit"], found.groups["parameters"]
    if fit.attributes["robot"] != robot.name:
        raise InputError(
            "these numbers were identified for another robot", where=words, expected=robot.name,
            received=str(fit.attributes["robot"]), hint="r2s2r identify",
        )  # fmt: skip
    known = entries(robot)
    names = [name.decode() for name in table["name"].tolist()]
    for name in names:
        if name not in known:
            raise InputError(
                f"the identification has a number {name} that this robot.toml does not have", where=words,
                expected="numbers of the robot, as `r2s2r identify --help` lists them", received=name,
                hint="r2s2r identify --force",
            )  # fmt: skip
    by_hand = table["trust"] == FIXED_BY_HAND
    free = np.flatnonzero(~by_hand)
    frees = tuple(_free(known[names[k]].free, table, k) for k in free.tolist())
    fixed = {names[k]: float(table["value"][k]) for k in np.flatnonzero(by_hand).tolist()}
    whole = found.groups["covariance"]["covariance"] if "covariance" in found.groups else None
    covariance = np.full((len(free), len(free)), np.nan) if whole is None else whole[np.ix_(free, free)]
    said = np.isfinite(np.diag(covariance)) & table["identifiable"][free]
    covariance = np.where(said[:, None] & said[None, :], covariance, np.nan)
    effects = tuple(str(fit.attributes["effects"]).split())
    mapping = Mapping(robot, frees, effects, fixed=fixed)
    loop = found.groups.get("sensing")
    return Identified(
        words, robot, mapping, table["value"][free].astype(float), covariance,
        None if loop is None else loop["bias"], None if loop is None else float(loop.attributes["command_delay"]),
    )  # fmt: skip


def _free(own: Free, table: Group, k: int) -> Free:
    """The number as it was free: bounds, prior and coordinate of the identification."""
    low, high = (float(end) for end in table["bounds"][k])
    mean, sd = float(table["prior_mean"][k]), float(table["prior_sd"][k])
    return replace(
        own,
        start=mean if math.isfinite(mean) else float(table["start"][k]),
        off=None,
        lower=low if math.isfinite(low) else own.lower,
        upper=high if math.isfinite(high) else own.upper,
        coordinate=_COORDINATES[int(table["coordinate"][k])],
        prior_sd=sd if math.isfinite(sd) else math.inf,
    )


def _inside(free: Free, value: float) -> float:
    """The value, off the bounds by a hair."""
    width = free.upper - free.lower
    if not math.isfinite(width):
        return value
    return min(max(value, free.lower + NARROW * width), free.upper - NARROW * width)
