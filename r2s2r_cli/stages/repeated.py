"""Which policy a recorded run executed: repeats of one policy are named after it, with their number."""

from __future__ import annotations

from r2s2r_cli.artifact import ArtifactData


def policy_of(data: ArtifactData, run: str) -> str:
    """Name of the policy: that of the run without the number of its repeat, where the policy was repeated. One that was
    run once gives its run its own name, which may end in a number too: `forward-1` say."""
    stem = run.removesuffix(f"-{_repeat(data, run)}")
    more = [one for one in data.runs() if (number := _repeat(data, one)) > 1 and one == f"{stem}-{number}"]
    return stem if more else run


def _repeat(data: ArtifactData, run: str) -> int:
    """Number of the repeat; 0 where the run has none."""
    return int(data.groups[f"runs/{run}"].attributes.get("repeat", 0))
