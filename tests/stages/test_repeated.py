"""Runs by the policy that they executed."""

from __future__ import annotations

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.repeated import asked_repeats, policy_of


def recorded(**repeats: int) -> ArtifactData:
    """Runs by name, with the number of their repeat; 0: they have none."""
    roots = {f"runs/{run.replace('_', '-')}": Group({}, {"repeat": number} if number else {})
             for run, number in repeats.items()}  # fmt: skip
    return ArtifactData("recording", roots)


def test_repeats_are_runs_of_one_policy() -> None:
    """Three of one policy; of a log the name is the run's."""
    data = recorded(straight_1=1, straight_2=2, straight_3=3, crawl=0)
    assert [policy_of(data, run) for run in data.runs()] == ["straight", "straight", "straight", "crawl"]


def test_gaits_with_a_number_that_were_run_once() -> None:
    """Their runs have their names, and no second repeat; with the command line's word as without."""
    data = recorded(forward_1=1, forward_2=1, straight=1)
    for repeats in (0, 1):
        assert [policy_of(data, run, repeats) for run in data.runs()] == ["forward-1", "forward-2", "straight"]


def test_repeats_of_a_gait_with_a_number() -> None:
    """`forward-2` twice is that gait."""
    data = recorded(forward_2_1=1, forward_2_2=2)
    assert [policy_of(data, run) for run in data.runs()] == ["forward-2", "forward-2"]


def test_interrupted_repeats_keep_their_policy() -> None:
    """Cut off before `b-2`: `b-1` is a run of `b` all the same; in the first round the command line tells it."""
    data = recorded(a_1=1, b_1=1, a_2=2)
    assert [policy_of(data, run) for run in data.runs()] == ["a", "b", "a"]
    data = recorded(a_1=1, b_1=1)
    assert [policy_of(data, run, asked_repeats({"flags": {"repeats": 2}})) for run in data.runs()] == ["a", "b"]
    assert asked_repeats({"flags": {"repeats": None}}) == asked_repeats({}) == 0
