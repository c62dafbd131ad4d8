"""Target intervals and segments, as tables inside a run.

Frames are counted among the kept frames of `caps`; in an imported run without caps, among the kept frames of `commands`;
in a run that `record` made, they are the rows of `commands`: control ticks, all of which count.
"""

from __future__ import annotations

from schemas.base import GroupSpec, column

INTERVALS = GroupSpec(
    path="runs/{run}/intervals",
    description="target intervals: maximal time spans of one constant target vector; row i is interval i + 1",
    datasets=(
        column("first", "int64", ("interval",), "index", "first kept frame (index among kept frames)"),
        column("last", "int64", ("interval",), "index", "last kept frame"),
        column("t_first", "float64", ("interval",), "s", "time of the first kept frame"),
        column("t_last", "float64", ("interval",), "s", "time of the last kept frame"),
        column("target", "float64", ("interval", "actuated"), "1", "the target vector"),
        column("complete", "bool", ("interval",), "bool",
               "another row follows it, or it has moved to its end, and neither a hole in the frames that hides other targets "
               "nor a camera that lost the robot lies at its first or last frame: it may be trained on and judged"),
    ),
)  # fmt: skip

SEGMENTS = GroupSpec(
    path="runs/{run}/segments",
    description="segments: intervals cut again where the control of a cable reverses",
    datasets=(
        column("interval", "int64", ("segment",), "index", "interval it belongs to, 1-based"),
        column("first", "int64", ("segment",), "index", "first kept frame (index among kept frames)"),
        column("last", "int64", ("segment",), "index", "key frame: the last kept frame"),
        column("t_first", "float64", ("segment",), "s", "time of the first kept frame"),
        column("t_last", "float64", ("segment",), "s", "time of the key frame"),
        column("direction", "int32", ("segment", "actuated"), "1",
               "-1 extends, 0 holds, +1 reels in; absent where the control was not logged", required=False),
        column("complete", "bool", ("segment",), "bool", "as in intervals"),
    ),
)  # fmt: skip
