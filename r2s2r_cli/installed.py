"""Which effects installed packages bring, without loading them: what decides whether a diagnosis is fresh."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "r2s2r.effects"
"""The group of entry points. Each names an instance of a subclass of Effect, or the class itself."""


def installed() -> tuple[EntryPoint, ...]:
    """Entry points of effects, by name."""
    from importlib.metadata import entry_points  # few commands ask, and it loads much

    return tuple(sorted(entry_points(group=GROUP), key=lambda one: one.name))


def installed_words() -> str:
    """`side_wind (windy 1.0)`, with package and version, of every one of them; empty: there are none."""
    return ", ".join(
        one.name if one.dist is None else f"{one.name} ({one.dist.name} {one.dist.version})" for one in installed()
    )
