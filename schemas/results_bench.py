"""What `bench engine` prints with --json."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen


class Comparison(Frozen):
    """One quantity of both simulators, measured in turn in one process."""

    ours: float
    mujoco: float
    unit: Literal["steps/s", "s"]
    """steps/s: environment steps per second of processor time; s: seconds of processor time."""
    ratio: float
    """How many times faster ours is; below 1: slower."""
    spread: tuple[float, float]
    """Lowest and highest ratio of the repetitions."""
    what: str


class EngineBenchResult(Frozen):
    """What `bench engine` prints: processor time of one core, best of `repeats`."""

    schema_: Literal["r2s2r.bench.engine/1"] = Field(default="r2s2r.bench.engine/1", alias="schema")
    machine: str
    versions: dict[str, str]
    robot: str
    quick: bool
    """Short runs, few repetitions: a look, no measurement."""
    repeats: int
    step_s: float
    substeps: int
    """Engine steps a step: more than 1 where cables are too stiff for it."""
    mujoco_options: str
    forward_1: Comparison
    forward_64: Comparison
    forward_1024: Comparison
    gradient_10: Comparison
    """Gradient of one number along a run of `gradient_run_s` with respect to ten parameters: ours by a backward pass,
    MuJoCo's by eleven rollouts."""
    jacobian_10: Comparison
    """Jacobian of all end caps along the same run: ours in one pass with ten tangents, MuJoCo's by the same rollouts."""
    gradient_run_s: float
    parameters: tuple[str, ...]
    compile_s: float
    """Wall time from the first call to its result in a fresh process without a cache: forward and backward pass [s]."""
    compile_parts_s: dict[str, float]
    cached_start_s: float
    """The same with the machine code cached on disk [s]."""
    peak_memory_bytes: dict[str, int]
    """Of a process that does all of the above with one simulator: `ours`, `mujoco`."""
