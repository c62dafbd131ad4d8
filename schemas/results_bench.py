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


class Share(Frozen):
    """`count` of `total`, and the 95 % interval (Wilson) of the probability behind it."""

    count: int
    total: int
    low: float
    high: float


class IdentifiedCase(Frozen):
    """What one tool found in one case; lists in the order of `parameters`."""

    seed: int
    truth: tuple[float, ...]
    start: tuple[float, ...]
    estimate: tuple[float, ...]
    low: tuple[float | None, ...]
    """Ends of the 95 % intervals; null: the tool gave none."""
    high: tuple[float | None, ...]
    cpu_s: float
    """Processor time of the fit and its intervals, all threads [s]."""
    rollouts: float
    """Simulations of the whole gait, or as much of several shorter ones."""
    rms_mm: float
    """What the fit leaves of an observed coordinate; the noise is `noise_mm`."""
    solved: bool
    """Every parameter within the larger of 2 % and 3 reported standard deviations of its planted value."""
    failed: str | None = None
    """Why there is no estimate."""


class IdentifiedBy(Frozen):
    """One tool with one set of options, over all cases."""

    what: str
    cases: tuple[IdentifiedCase, ...]
    solved: Share
    covered: Share
    """Planted values inside their intervals, of all values; one without an interval is not covered."""
    without_interval: int
    """Values whose interval is infinite or not a number."""
    cpu_median_s: float
    error_median: float
    """Of the relative errors of all values."""
    cpu_ratio: float
    """Its processor time in all cases over ours: one hard case can decide it."""
    cpu_median_ratio: float
    """Median over the cases of its processor time over ours in the same one."""


class IdentifyBenchResult(Frozen):
    """What `bench identify` prints."""

    schema_: Literal["r2s2r.bench.identify/1"] = Field(default="r2s2r.bench.identify/1", alias="schema")
    machine: str
    versions: dict[str, str]
    robot: str
    run_s: float
    step_s: dict[str, float]
    """Of the simulations: `ours`, `mujoco`."""
    noise_mm: float
    frames_per_s: float
    hard: bool
    """Attachment phases and initial velocities are unknown as well."""
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    tools: dict[str, IdentifiedBy]
    """`ours`, `mujoco.sysid` with its defaults, `mujoco.sysid jac` with x_scale='jac', `mujoco.sysid growing`."""
    compile_s: float
    """Processor time of our first simulations with and without derivatives, compilation included, before any fit [s]."""


class DiagnoseBenchResult(Frozen):
    """What `bench diagnose` prints: one diagnosis with the whole catalogue."""

    schema_: Literal["r2s2r.bench.diagnose/1"] = Field(default="r2s2r.bench.diagnose/1", alias="schema")
    machine: str
    gaits: int
    robot_s: float
    """How long the robot walked in all of them."""
    threads: int
    first_s: float
    """With compiling the machine code, which is kept."""
    wall_s: float
    cpu_s: float
    seconds: dict[str, float]
    """Wall time of each part."""
    rollouts: int
    verdict: str
    effects: tuple[str, ...]
