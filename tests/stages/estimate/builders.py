"""Recordings and robots for the tests of `estimate`."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.import_.trajectory import import_trajectory
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.segments import segments, target_intervals
from schemas.robot import Robot
from schemas.sidecar import Sidecar
from tests.stages.estimate.planted import N_INTERVALS, Planted

RUN = {"origin": "trajectory_csv", "nature": "kinematic sample", "source": "planted", "robot": "threebar"}


def threebar() -> Robot:
    """The 3-bar robot of the paper, as `init` writes it."""
    return Robot.model_validate(tomllib.loads(robot_toml("threebar")))


def recording(
    sample: Planted, *, run: str = "planted", shift_m: float = 0.0, caps: np.ndarray | None = None
) -> ArtifactData:
    """A recording of one planted run, ground at -shift_m; `caps` replaces the observations."""
    t = sample.t
    p_WE = (sample.observed if caps is None else caps) - np.array([0.0, 0.0, shift_m])
    target = np.repeat((np.searchsorted(sample.first, np.arange(len(t)), side="right") % 2)[:, None], 6, axis=1) * 1.0
    intervals = target_intervals(t, target)
    assert len(intervals) == N_INTERVALS
    groups = {
        f"runs/{run}": Group({}, dict(RUN)),
        f"runs/{run}/caps": Group(
            {
                "t": t,
                "p_WE": p_WE,
                "drop_reason": np.zeros(len(t), dtype=np.uint8),
                "source_row": np.arange(len(t)) + 2,
            }
        ),
        f"runs/{run}/commands": Group({"t": t, "target": target}),
        f"runs/{run}/intervals": intervals.to_group(),
        f"runs/{run}/segments": segments(intervals, t).to_group(),
    }
    return ArtifactData("recording", groups)


def replaced(data: ArtifactData, path: str, **datasets: np.ndarray) -> ArtifactData:
    """The same artifact with other datasets in one group."""
    group = data.groups[path]
    return ArtifactData(data.kind, {**data.groups, path: Group({**group.datasets, **datasets}, group.attributes)})


def real_crawl(real_dir: Path) -> ArtifactData:
    """The real crawl as `import` stores it."""
    folder = real_dir / "tribar_crawl"
    sidecar = Sidecar.model_validate(tomllib.loads((folder / "crawl.toml").read_text()))
    groups, _ = import_trajectory(
        (folder / "crawl.csv").read_bytes(), "crawl", robot=threebar(), sidecar=sidecar, where="crawl.csv"
    )
    return ArtifactData("recording", {f"runs/crawl/{name}".rstrip("/"): group for name, group in groups.items()})
