"""Plans."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.checks.subjects import Content
from tests.checks.case import Case, Edge
from tests.support import builders
from tests.support.check_subjects import edited_content, plan, put


def _edited(path: str, place: object, value: object) -> Content:
    return edited_content(plan(), path, put(place, value))


def _without(group: str) -> Content:
    groups = {path: one for path, one in builders.plan().groups.items() if path != group}
    return Content(ArtifactData("plan", groups))


FAILS: tuple[Case, ...] = (
    Case(
        "plan_policies_exist",
        lambda: _without("policies/forward-2"),
        (("primitives/name", "row 1 has no policy", "policies/forward-2", "none"),),
    ),
    Case(
        "plan_policies_exist",
        lambda: _edited("primitives/name", 1, b"forward-1"),
        (("primitives/name", "two policies have the same name", "a name for each", "forward-1"),),
    ),
    Case(
        "plan_symmetries_valid",
        lambda: _edited("symmetry/motors", (1, 0), 0),
        (("symmetry/motors", "a symmetry takes two parts to one place", "each of 0 .. 5", "0 0 1 5 3 4 in row 1"),),
    ),
    Case(
        "plan_symmetries_valid",
        lambda: _edited("symmetry/caps", 0, np.array([1, 0, 2, 3, 4, 5])),
        (("symmetry/caps", "the first symmetry is not the identity", "0 1 2 3 4 5", "1 0 2 3 4 5"),),
    ),
    Case(
        "plan_symmetries_valid",
        lambda: _edited("symmetry/turn", 1, np.diag([1.0, 1.0, -1.0])),
        (("symmetry/turn", "a symmetry is no rotation", "columns at right angles, determinant 1",
          "off by 2 in row 1"),),
    ),
    Case(
        "plan_gaits_sound",
        lambda: _edited("primitives/element", 1, 2),
        (("primitives/element", "a gait ends as a symmetry that is not there", "0 .. 1", "2 at row 1"),),
    ),
    Case(
        "plan_gaits_sound",
        lambda: _edited("primitives/worked", 0, 1.25),
        (("primitives/worked", "a share is out of range", "0 .. 1", "1.25 at row 0"),),
    ),
    Case(
        "plan_policies_reliable",
        lambda: _edited("long/worked", 0, 0.375),
        (("long/worked", "straight seldom comes back to rest", "50% of the draws or more", "38%"),),
    ),
)  # fmt: skip

EDGES: tuple[Edge, ...] = (
    Edge("plan_policies_exist", "no long policies", lambda: _without("long")),
    Edge("plan_symmetries_valid", "rounding", lambda: _edited("symmetry/turn", (1, 0, 1), 1e-9)),
    Edge("plan_gaits_sound", "it never worked", lambda: _edited("primitives/worked", 1, 0.0)),
    Edge("plan_policies_reliable", "half of them", lambda: _edited("long/worked", 0, 0.5)),
)
