"""Which effects installed packages bring, without loading them: what decides whether a diagnosis is fresh."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

GROUP = "r2s2r.effects"
"""The group of entry points. Each names an instance of a subclass of Effect, or the class itself."""


def installed() -> tuple[EntryPoint, ...]:
    """Entry points of effects, by name."""
    return tuple(sorted(entry_points(group=GROUP), key=lambda one: one.name))


def installed_versions() -> dict[str, str]:
    """`package version` of every installed effect, by its id."""
    return {
        one.name: "no package" if one.dist is None else f"{one.dist.name} {one.dist.version}" for one in installed()
    }
