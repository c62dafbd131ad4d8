"""What checks look at: values that the command has gathered, with the paths to name in messages."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import R2S2RError
from schemas.base import ArtifactSpec
from schemas.header import Header, InputRef
from schemas.robot import Robot
from schemas.versions import KINDS

KEPT = 0
"""Code of `drop_reason` for a frame that counts."""


@dataclass(frozen=True)
class Difference:
    """One place where a file departs from its seal or its schema."""

    where: str
    what: str
    expected: str
    received: str
    hint: str = ""
    """Where it needs another remedy than the check that found it."""


@dataclass(frozen=True)
class Reading:
    """What came of reading one file."""

    refused: tuple[R2S2RError, ...] = ()
    """Why it cannot be read at all."""
    wrong: tuple[R2S2RError, ...] = ()
    """What is not allowed in a TOML file that can be read: keys and values that its model refuses."""
    newer: bool = False
    """`refused` because of its kind or version, not because it is damaged."""
    damage: tuple[Difference, ...] = ()
    """Where it is not what was sealed."""
    unread_bytes: bool = False
    """Bytes changed, and the content hash proves that nothing readable did."""


@dataclass(frozen=True)
class Content:
    """The values of one artifact and what its layout check said."""

    data: ArtifactData
    layout: tuple[Difference, ...] = ()

    @property
    def kind(self) -> str:
        """Artifact kind."""
        return self.data.kind

    @property
    def spec(self) -> ArtifactSpec:
        """The layout of its kind."""
        return KINDS[self.kind]


@dataclass(frozen=True)
class InputState:
    """One recorded input and what is there now."""

    ref: InputRef
    sha256: str | None
    """Digest of what is there now; None: it is gone or cannot be read."""
    problem: str = ""
    """In words, where it cannot be read."""


@dataclass(frozen=True)
class Links:
    """How one artifact hangs together with the rest of the project."""

    header: Header
    body: Mapping[str, Any]
    """The same facts as the HDF5 body holds them: root attributes and fields of `provenance`."""
    inputs: tuple[InputState, ...] = ()
    robots: Mapping[str, str] = field(default_factory=dict)
    """Location -> name of the robot the data are of."""
    project_robot: str | None = None
    stage_versions: Mapping[str, int] = field(default_factory=dict)
    """The newest version of each stage that this r2s2r knows."""
    filename: str = ""
    """Name of the file, where it lies in a project's place for artifacts."""
    belongs: str = ""
    """Where it lies under another name than that of its kind: path of the place of its kind, if that is free."""

    @property
    def kind(self) -> str:
        """Artifact kind."""
        return self.header.kind


@dataclass(frozen=True)
class Journals:
    """Recordings of a project that were never sealed, by path."""

    paths: tuple[str, ...]


@dataclass(frozen=True)
class Run:
    """One run of a recording, estimate or simulation."""

    kind: str
    name: str
    streams: Mapping[str, Group]
    """By stream; the run's own attributes under ''."""
    project_robot: Robot | None = None
    """The project's robot, where the run is of that robot by name."""

    def array(self, stream: str, name: str) -> np.ndarray | None:
        """A dataset, or None where the run does not have it."""
        group = self.streams.get(stream)
        value = group.datasets.get(name) if group is not None else None
        return value if isinstance(value, np.ndarray) else None

    def attribute(self, stream: str, name: str) -> float | None:
        """A numeric attribute, or None."""
        group = self.streams.get(stream)
        value = group.attributes.get(name) if group is not None else None
        return float(value) if isinstance(value, int | float) else None

    def at(self, stream: str, name: str = "") -> str:
        """The path of a stream or dataset, as messages name it."""
        return "/".join(part for part in ("runs", self.name, stream, name) if part)

    @property
    def frame(self) -> str:
        """What the index of a frame counts."""
        return "kept frame" if self.kind == "recording" else "frame"

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Length of the axes that the robot fixes: cap, rod, cable, actuated, as far as the run has them."""
        found: dict[str, int] = {}
        for stream, group in self.streams.items():
            spec = KINDS[self.kind].group(self.at(stream))
            for dataset in spec.datasets if spec else ():
                value = group.datasets.get(dataset.path)
                if isinstance(value, np.ndarray) and value.ndim == len(dataset.dims):
                    found |= {axis: n for axis, n in zip(dataset.dims, value.shape, strict=True) if axis in _ROBOT_AXES}
        return found

    @cached_property
    def robot(self) -> Robot | None:
        """The robot, where the run has as many caps, rods and cables as it; else None."""
        robot = self.project_robot
        if robot is None:
            return None
        wanted = robot_sizes(robot)
        return robot if all(wanted[axis] == size for axis, size in self.sizes.items()) else None

    @cached_property
    def kept(self) -> np.ndarray | None:
        """Mask of the kept rows of `caps`; None where there are no caps."""
        reason = self.array("caps", "drop_reason")
        return None if reason is None else reason == KEPT

    @property
    def stamps(self) -> tuple[str, np.ndarray] | None:
        """(location, stamps [s]) of the kept frames, as intervals and segments count them; None: not known here."""
        t, kept = self.array("caps", "t"), self.kept
        if t is not None and kept is not None:
            return self.at("caps", "t"), t[kept]
        t = self.array("frames", "t")
        return None if t is None else (self.at("frames", "t"), t)

    @property
    def p_WE(self) -> tuple[str, np.ndarray] | None:
        """(location, end caps [m] (frame, cap, xyz), world frame) of the kept frames; None where there are none."""
        p, kept = self.array("caps", "p_WE"), self.kept
        if p is not None and kept is not None:
            return self.at("caps", "p_WE"), p[kept]
        p = self.array("frames", "p_WE")
        return None if p is None else (self.at("frames", "p_WE"), p)


@dataclass(frozen=True)
class Policy:
    """One policy, from its own TOML file or from a group of an artifact."""

    root: str
    """Group path; '' for a TOML file."""
    robot_name: str
    target: np.ndarray
    """(step, actuated)"""
    hold: np.ndarray
    """[s], (step,)"""
    timeout: np.ndarray
    """[s], (step,); NaN: the robot's default."""
    repeat: int
    project_robot: Robot | None = None

    def at(self, name: str) -> str:
        """Path of one of its fields; in a TOML file the key `steps`."""
        return f"{self.root}/{name}" if self.root else "steps"


_ROBOT_AXES = ("cap", "rod", "cable", "actuated")


def robot_sizes(robot: Robot) -> dict[str, int]:
    """Length of each axis that the robot fixes."""
    return {
        "cap": robot.n_caps, "rod": len(robot.rods), "cable": len(robot.cables), "actuated": len(robot.actuated),
    }  # fmt: skip


def runs_of(data: ArtifactData, robot: Robot | None) -> list[Run]:
    """The runs of an artifact; each knows the robot if it is of that robot by name."""
    found = []
    for name in data.runs():
        streams = dict(data.streams(name))
        own = streams[""].attributes.get("robot") if "" in streams else None
        found.append(Run(data.kind, name, streams, robot if robot is not None and own == robot.name else None))
    return found


def policies_of(data: ArtifactData, robot: Robot | None) -> list[Policy]:
    """The policies of an artifact: its own, and those that runs carry."""
    return [
        Policy(
            path, str(group.attributes["robot"]), group["target"], group["hold"], group["timeout"],
            int(group.attributes["repeat"]), robot,
        )
        for path, group in data.groups.items()
        if re.fullmatch(r"policies/[^/]+|runs/[^/]+/policy", path)
    ]  # fmt: skip
