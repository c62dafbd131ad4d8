"""Which policy a recorded run executed: repeats of one policy are named after it, with their number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from r2s2r_cli.artifact import ArtifactData


def policy_of(data: ArtifactData, run: str, repeats: int = 0) -> str:
    """Name of the policy: that of the run without the number of its repeat, where the policies were repeated. One that
    was run once gives its run its own name, which may end in a number too: `forward-1` say.

    repeats: how often each policy was to be run, 0: not known (`asked_repeats`). Then it is told by the runs: one
    command line repeats all its policies or none, so that one second repeat is enough, whatever cut the recording off.
    """
    stem = run.removesuffix(f"-{_repeat(data, run)}")
    return stem if repeats > 1 or (repeats == 0 and _repeated(data)) else run


def asked_repeats(settings: Mapping[str, Any]) -> int:
    """How often each policy was to be run, by the flags in a recording's provenance; 0: they do not say."""
    told = settings.get("flags", {}).get("repeats")
    return told if isinstance(told, int) else 0


def _repeated(data: ArtifactData) -> bool:
    """Whether the runs are repeats: one is the second of its policy or later, and all have their numbers as names."""
    numbers = {one: number for one in data.runs() if (number := _repeat(data, one))}
    return max(numbers.values(), default=0) > 1 and all(
        one.endswith(f"-{number}") for one, number in numbers.items()
    )  # fmt: skip


def _repeat(data: ArtifactData, run: str) -> int:
    """Number of the repeat; 0 where the run has none."""
    return int(data.groups[f"runs/{run}"].attributes.get("repeat", 0))
