"""Plans: tables that agree with the policies beside them, symmetries that are some, gaits that come back to rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import REPORT, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Content

_KINDS = ("plan",)
TURN = 1e-6
"""How far a rotation may be from one, by any number of it."""
RELIABLE = 0.5
"""A long policy that comes back to rest in fewer of the drawn simulators goes astray more often than not."""


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every gait and long policy has one name, and the policy of that name",
    why="what is executed is the policy, what was judged is the row: they must be the same",
    fix=REPORT,
)
def plan_policies_exist(content: Content) -> Iterator[Found]:
    """Rows without their policy, and doubles."""
    counts: Counter[str] = Counter()
    for table in ("primitives", "long"):
        names = _get(content, table, "name")
        for row, name in enumerate([] if names is None else names.tolist()):
            text = name.decode("utf-8", errors="replace") if isinstance(name, bytes) else str(name)
            counts[text] += 1
            if f"policies/{text}" not in content.data.groups:
                yield Found(f"{table}/name", f"row {row} has no policy", f"policies/{text}", "none")
    for name, times in counts.items():
        if times > 1:
            yield Found("primitives/name", "two policies have the same name", "a name for each", name)


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every symmetry changes places one for one, the first changes none, and each is a rotation",
    why="a gait that is relabelled by anything else is another gait",
    fix=REPORT,
)
def plan_symmetries_valid(content: Content) -> Iterator[Found]:
    """Rows that are no permutation, turns that are no rotation."""
    for name in ("caps", "cables", "motors"):
        table = _get(content, "symmetry", name)
        if table is None or table.ndim != 2:
            continue
        plain = np.arange(table.shape[1])
        wrong = np.flatnonzero((np.sort(table, axis=1) != plain).any(axis=1))
        if len(wrong):
            yield Found(f"symmetry/{name}", "a symmetry takes two parts to one place", f"each of 0 .. {len(plain) - 1}",
                        f"{' '.join(map(str, table[wrong[0]].tolist()))} in row {wrong[0]}")  # fmt: skip
        elif len(table) and (table[0] != plain).any():
            yield Found(f"symmetry/{name}", "the first symmetry is not the identity", " ".join(map(str, plain)),
                        " ".join(map(str, table[0].tolist())))  # fmt: skip
    turn = _get(content, "symmetry", "turn")
    if turn is not None and turn.shape[1:] == (3, 3):
        off = np.abs(turn @ turn.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
        off = np.maximum(off, np.abs(np.linalg.det(turn) - 1.0))
        if (off > TURN).any():
            row = int(off.argmax())
            yield Found("symmetry/turn", "a symmetry is no rotation", "columns at right angles, determinant 1",
                        f"off by {number(off[row])} in row {row}")  # fmt: skip


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every gait ends as one of the symmetries, and every share lies within 0 .. 1",
    why="a sequence is made of what its gaits do to the robot",
    fix=REPORT,
)
def plan_gaits_sound(content: Content) -> Iterator[Found]:
    """Elements without a row, shares that are none."""
    element, rows = _get(content, "primitives", "element"), _get(content, "symmetry", "caps")
    if element is not None and rows is not None and len(element):
        outside = beyond(element.astype(float), 0, len(rows) - 1)
        if (outside > 0).any():
            yield Found("primitives/element", "a gait ends as a symmetry that is not there", f"0 .. {len(rows) - 1}",
                        worst(element, outside, ("row",)))  # fmt: skip
    for table, name in (("primitives", "worked"), ("primitives", "same_element"), ("long", "worked")):
        share = _get(content, table, name)
        outside = np.zeros(0) if share is None else beyond(share, 0.0, 1.0)
        if share is not None and (outside > 0).any():
            yield Found(f"{table}/{name}", "a share is out of range", "0 .. 1", worst(share, outside, ("row",)))


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="long policies come back to rest in most of the drawn simulators",
    why="the robot is one more of them: where a target is given up, what follows is relabelled for another triangle",
    fix="r2s2r inspect {file}   # names its gaits: execute them one by one, or learn more of the robot first",
)
def plan_policies_reliable(content: Content) -> Iterator[Found]:
    """Long policies that mostly do not."""
    worked, names = _get(content, "long", "worked"), _get(content, "long", "name")
    if worked is None or names is None or len(worked) != len(names):
        return
    for row in np.flatnonzero(worked < RELIABLE).tolist():
        name = names[row].decode("utf-8", errors="replace") if isinstance(names[row], bytes) else str(names[row])
        yield Found("long/worked", f"{name} seldom comes back to rest", f"{RELIABLE:.0%} of the draws or more",
                    f"{worked[row]:.0%}")  # fmt: skip


def _get(content: Content, group: str, name: str) -> np.ndarray | None:
    found = content.data.groups.get(group)
    value = found.datasets.get(name) if found is not None else None
    return value if isinstance(value, np.ndarray) else None
