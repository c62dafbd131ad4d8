"""Runs by the policy that they executed."""

from __future__ import annotations

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.repeated import policy_of


def recorded(**repeats: int) -> ArtifactData:
    """Runs by name, with the number of their repeat; 0: they have none."""
    roots = {f"runs/{run.replace('_', '-')}": Group({}, {"repeat": number} if number else {})
             for run, number in repeats.items()}  # fmt: skip
    return ArtifactData("recording", roots)


def test_repeats_are_runs_of_one_policy() -> None:
    """Three of one policy; of a gait that was run once, and of a log, the name is the policy's."""
    data = recorded(straight_1=1, straight_2=2, straight_3=3, forward_1=1, forward_2=1, crawl=0)
    assert [policy_of(data, run) for run in data.runs()] == [
        "straight", "straight", "straight", "forward-1", "forward-2", "crawl",
    ]  # fmt: skip


def test_repeats_of_a_gait_with_a_number() -> None:
    """`forward-2` twice is that gait, and `forward-1` once is another one."""
    data = recorded(forward_1=1, forward_2_1=1, forward_2_2=2)
    assert [policy_of(data, run) for run in data.runs()] == ["forward-1", "forward-2", "forward-2"]
