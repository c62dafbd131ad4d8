"""Reasons for people: where many values of one file changed, their number and an example instead of all of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

MANY = 3
"""So many values of one file are still listed each by itself."""

_VALUE = re.compile(r"(?P<of>robot\.toml: |setting (?P<stage>\w+)\.)(?P<key>\S+) was ")
"""How `reasons` begins to name a changed value."""


def brief(reasons: Sequence[str]) -> list[str]:
    """The reasons with one line for the many changed values of robot.toml, or of the settings of a stage."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for number, text in enumerate(reasons):
        found = _VALUE.match(text)
        groups.setdefault(found["of"] if found else str(number), []).append((found["key"] if found else "", text))
    return [line for of, members in groups.items() for line in _lines(of, members)]


def _lines(of: str, members: Sequence[tuple[str, str]]) -> list[str]:
    if len(members) <= MANY:
        return [text for _, text in members]
    tops = dict.fromkeys(f"{key.partition('.')[0]}.*" if "." in key else key for key, _ in members)
    what = "values of robot.toml" if of.startswith("robot.toml") else f"settings of {of.split()[1].rstrip('.')}"
    return [f"{len(members)} {what} changed ({', '.join(tops)}), the first: {members[0][1].removeprefix(of)}"]
