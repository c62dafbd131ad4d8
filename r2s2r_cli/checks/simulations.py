"""What only a simulated run has: tensions and rest lengths."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.checks.base import AGAIN, REPORT, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Run

PUSH_N = 1e-9
"""Rounding."""


@check(
    "error",
    Run,
    kinds=("simulation",),
    what="cables pull or are slack, they never push",
    why="a cable that pushes is a rod; damping that is not limited does that to a slack cable",
    fix=REPORT,
)
def cables_never_push(run: Run) -> Iterator[Found]:
    """Negative tensions."""
    tension = run.array("frames", "tension")
    if tension is not None:
        push = beyond(tension, -PUSH_N, float("inf"))
        if (push > 0).any():
            yield Found(run.at("frames", "tension"), "a cable pushes", "a tension of 0 N or more",
                        worst(tension, push, ("frame", "cable"), unit="N"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=("simulation",),
    what="rest lengths are above 0",
    why="a winch that reels in a whole cable has no cable left to pull with",
    fix=f"{AGAIN}   # first compare pid.min_length_m and the targets of the policy with the robot",
)
def rest_lengths_positive(run: Run) -> Iterator[Found]:
    """Cables without length."""
    rest = run.array("frames", "rest_length")
    if rest is not None and (rest <= 0).any():
        yield Found(run.at("frames", "rest_length"), "a cable has no length left", "above 0 mm",
                    worst(rest, (rest <= 0) * (1.0 - rest), ("frame", "cable"), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=("simulation",),
    what="the time step of the engine is above 0 and not longer than the gap between stored frames",
    why="frames between two steps were made up",
    fix=REPORT,
)
def step_fits_frames(run: Run) -> Iterator[Found]:
    """A step that the frames contradict."""
    step, t = run.attribute("", "step"), run.array("frames", "t")
    if step is None or t is None:
        return
    gap = float((t[1:] - t[:-1]).min()) if len(t) > 1 else float("inf")
    if step <= 0 or step > gap * (1 + 1e-6):
        limit = f", at most {number(gap)} s" if gap < float("inf") else ""
        yield Found(f"{run.at('')}@step", "the time step does not fit the stored frames", f"above 0 s{limit}",
                    f"{number(step)} s")  # fmt: skip
