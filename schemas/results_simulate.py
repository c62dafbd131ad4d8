"""What `simulate` says about its runs: printed as a table, and put into its `--json` document. SI."""

from __future__ import annotations

from typing import Literal

from schemas.base import Frozen


class SimulateRun(Frozen):
    """One simulated run."""

    run: str
    policy: str
    """Name of the policy, or of the recorded run whose motor commands were replayed."""
    control: Literal["closed loop", "command replay"]
    start: str
    """`rest`, or the run whose first estimated state it started from."""
    start_shift_m: float
    """How far the farthest cap moved while the start settled under gravity and tension."""
    frames: int
    duration_s: float
    step_s: float
    substeps: int
    """Steps of the engine in each `step_s`: as many as stiff cables need."""
    targets: int
    """Target shapes of the policy, repeats counted; 0 for a replay."""
    timed_out: tuple[int, ...]
    """Targets that were given up, 1-based."""
    com_displacement_m: tuple[float, float, float]
    """Of the centre of mass, from the first to the last frame, frame W."""
    com_path_m: float
    """Way of the centre of mass over the ground, along the stored frames."""
    heading_change_rad: float | None
    """Turn of the mean rod axis (even to odd cap) about the vertical, counter-clockwise positive, whole turns counted.
    None where the axes cancel or stand upright at some frame."""
    penetration_max_m: float
    """Deepest that any cap was below the ground, at the stored frames."""
    cap_height_max_m: float
    tension_max_n: float
    tension_max_cable: int
    slack_share: tuple[float, ...]
    """Share of the frames in which each cable is slack."""
    warnings: tuple[str, ...] = ()


class SimulateReport(Frozen):
    """All runs of one `simulate`."""

    runs: tuple[SimulateRun, ...]
    computed_by: Literal["machine code", "torch"]
    """torch: where no machine code can be made; the same numbers to rounding, some hundred times slower."""
