"""What `record` says about its runs: printed as a table, put into its `--json` document and into the recording."""

from __future__ import annotations

from pydantic import Field

from schemas.base import Frozen


class CameraCounts(Frozen):
    """Pictures of one run."""

    frames: int
    lost: int
    """Gaps in the camera's own count, and what this host could not take."""
    repeated: int = 0
    """Frames equal to the one before, to the last bit of depth: a frozen camera."""
    rate_hz: float | None = None
    """Frames a second that were written."""


class RecordRun(Frozen):
    """One recorded run. SI. Counts are of this run alone; None: the protocol cannot tell."""

    run: str
    policy: str
    repeat: int
    """Which repeat of its policy, from 1."""
    ended: str
    """`complete`, or what ended it before its last target."""
    targets: int
    """With the rest shape before and after."""
    targets_done: int
    timed_out: tuple[int, ...] = ()
    """Targets given up after their time-out, 1-based among the target intervals of the run."""
    duration_s: float
    ticks: int
    """Control ticks."""
    rate_hz: float | None = None
    """Control ticks a second."""
    late: int = 0
    """Control ticks more than half a period late."""
    held: int = 0
    """Control ticks in which the motors were held, since a sensor might have been frozen or the camera gave no frames."""
    samples: int
    lost: int | None = None
    repeated: int | None = None
    reordered: int | None = None
    corrupt: int = 0
    gap_max_s: float = 0.0
    """Longest time between two samples."""
    latency_median_s: float | None = None
    latency_p99_s: float | None = None
    clock_drift: float | None = None
    """Of the board's clock against the host's, seconds a second."""
    clock_jumps: int = 0
    """Times that a board's clock went back or leapt by more than a second."""
    silent_share: tuple[float, ...] = ()
    """By sensor: share of the control ticks at which it had no reading."""
    voltage_first_v: float | None = None
    voltage_last_v: float | None = None
    camera: CameraCounts | None = None
    warnings: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether it went through all targets."""
        return self.ended == "complete"


class RecordReport(Frozen):
    """All runs of one recording."""

    port: str
    protocol: str
    stops_by_itself: bool
    """The device stops its motors when the host falls silent."""
    clock: str
    """What the time of the runs counts: `host`, or `board` of a robot in lock-step."""
    runs: tuple[RecordRun, ...] = Field(default=())
    not_begun: tuple[str, ...] = ()
    """Runs that were asked for and did not come about."""
