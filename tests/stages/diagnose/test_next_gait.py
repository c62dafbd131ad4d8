"""What to run next: commands of an ideal controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.imagined import SETTLE_S, _before, commands, imagined
from r2s2r_cli.stages.diagnose.next_apart import apart, left
from r2s2r_cli.stages.diagnose.next_gait import _name, _remaining
from r2s2r_cli.stages.diagnose.sample import _at_rest, planted
from r2s2r_cli.stages.diagnose.stage import library_of
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH, gains_over_first
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, stretch_of
from r2s2r_cli.stages.diagnose.which.which import Compared
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.windows import window
from tests.support.builders import robot


def test_commands_wind_each_cable_as_far_as_its_target_asks() -> None:
    """Speed times the integral of the command is the way between targets, and shorter means +1."""
    targets = ((0.0, 1.0), (0.5, 0.25))
    control, t = commands(targets, 0.1, 0.05)
    wound = 0.05 * np.sum(control[:-1] * np.diff(t)[:, None], axis=0)
    assert wound == pytest.approx([0.1 * 0.5, 0.1 * 0.75])
    assert control[1].tolist() == [1.0, 0.0]
    assert t[-1] == pytest.approx(2.0 + 1.5 + 2 * SETTLE_S)


def test_commands_begin_where_the_cables_are() -> None:
    """A cable that the interval before had left short is let out, one that it had left where it should be stays."""
    control, t = commands(((0.5, 1.0),), 0.1, 0.05, before=np.array([0.0, 1.0]))
    wound = 0.05 * np.sum(control[:-1] * np.diff(t)[:, None], axis=0)
    assert wound == pytest.approx([-0.1 * 0.5, 0.0])
    assert t[-1] == pytest.approx(1.0 + SETTLE_S)
    run = SimpleNamespace(intervals=SimpleNamespace(target=np.array([[0.2, np.nan], [1.0, 0.3]])))
    first, second = (SimpleNamespace(interval=k, window=SimpleNamespace(run=run)) for k in (1, 2))
    assert _before(cast("Stretch", first)) is None  # robots are put down with all cables long
    assert _before(cast("Stretch", second)) == pytest.approx([0.2, 1.0])


def test_the_library_has_the_excitations_and_what_was_planned() -> None:
    """Ramps, holds, reversals, repeats, random gaits; a planned policy by its own name."""
    made = library_of(robot(), {"straight": [[1.0] * 6, [0.0] * 6]}).gaits
    assert {"ramps", "holds", "reversals", "repeats", "straight"} <= set(made)
    assert made["straight"][1] == (0.0,) * 6


def _compared(set90: Sequence[str], ranked: Mapping[str, float], fitted: Sequence[str]) -> Compared:
    """A ranking by name with its probabilities, and which of it was fitted."""
    fits = [SimpleNamespace(hypothesis=SimpleNamespace(parts=(name,), effects=(name,))) for name in fitted]
    ranking = [SimpleNamespace(effect=name, probability=p) for name, p in ranked.items()]
    base = SimpleNamespace(hypothesis=SimpleNamespace(parts=(), effects=()))
    return cast("Compared", SimpleNamespace(base=base, fits=fits, which=SimpleNamespace(set90=set90, ranking=ranking)))


def test_nothing_wrong_is_always_a_candidate_and_what_predicts_nothing_never() -> None:
    """Most probable first; three effects of the 90 % set at most; where it has none that a replay tells, the best of
    the rest stands against nothing wrong."""
    ranked = {"payload": 0.4, "none": 0.2, "unknown": 0.1, "dropout": 0.1, "a": 0.08, "b": 0.06, "c": 0.05}
    fits, p = _remaining(
        _compared(("payload", "dropout", "unknown", "a", "b", "c"), ranked, ("c", "b", "a", "payload"))
    )
    assert [_name(fit) for fit in fits] == ["payload", "none", "a", "b"]
    assert p.tolist() == [0.4, 0.2, 0.08, 0.06]
    fits, _ = _remaining(
        _compared(("none", "unknown"), {"none": 0.7, "unknown": 0.1, "a": 0.01, "b": 0.01}, ("b", "a"))
    )
    assert [_name(fit) for fit in fits] == ["none", "a"]
    fits, _ = _remaining(_compared(("dropout",), {"dropout": 0.9, "none": 0.1}, ()))
    assert [_name(fit) for fit in fits] == ["none"]


def _pieces(seed: int, count: int = 12, numbers: int = 40) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return list(rng.standard_normal((count, numbers)) / np.sqrt(numbers))


def _counted(half: float) -> float:
    """Of a piece that costs half more nats than the best one, as the ranking counts it."""
    return float(-gains_over_first(np.array([[0.0], [-half]]))[0])


def test_what_the_other_candidate_can_make_up_for_is_no_distance() -> None:
    """Differences that are three times a column of it: nothing is left but what its prior takes, 3^2 / 2 / 10^2 nats.
    Differences at right angles to all its columns are left whole, half their squares."""
    rng = np.random.default_rng(0)
    columns = [rng.standard_normal((2, 40)) for _ in range(12)]
    prior = np.diag([1e-2, 1e-2])
    assert left([3.0 * J[:1] for J in columns], columns, prior) == pytest.approx([0.045], rel=0.1)
    across = []
    for J, d in zip(columns, _pieces(1), strict=True):
        Q, _ = np.linalg.qr(J.T)
        across.append(0.2 * (d - Q @ (Q.T @ d))[None])
    assert left(across, columns, prior) == pytest.approx([0.5 * sum(float(np.sum(d**2)) for d in across)], rel=0.01)


def test_each_case_is_fitted_by_itself() -> None:
    """Two cases at once are what they are alone: one that a column explains, one that it does not."""
    columns = [np.eye(40)[:1]] * 3
    cases = np.stack([2.0 * np.eye(40)[0], 2.0 * np.eye(40)[1]])
    both = left([cases] * 3, columns, np.diag([1e-3]))
    alone = [left([cases[i : i + 1]] * 3, columns, np.diag([1e-3]))[0] for i in range(2)]
    assert both == pytest.approx(alone)
    assert both[0] < 0.01 and both[1] == pytest.approx(3 * _counted(2.0))


def test_no_piece_tells_candidates_apart_alone() -> None:
    """A fall that only one of two candidates has, 1000 nats of one piece, counts no more than 6, as in the ranking; by
    its logarithm, as up to version 19, it was 63. The same spread over 1000 pieces is nearly all of it."""
    none = np.zeros((0, 0))
    one = np.full((1, 40), np.sqrt(2000.0 / 40))
    empty = np.zeros((0, 40))
    (fall,) = left([one], [empty], none)
    assert fall == pytest.approx(_counted(1000.0)) and fall <= ENOUGH + 0.01
    (spread,) = left([one / np.sqrt(1000.0)] * 1000, [empty] * 1000, none)
    assert 900.0 < spread < 1000.0


def test_a_prior_that_is_paid_to_undo_a_fall_counts_no_more_than_the_fall() -> None:
    """A column that would undo it at 20 nats of its prior: the piece is worth 6, so that is what counts."""
    d = np.sqrt(2000.0) * np.eye(1, 40)
    (counted,) = left([d], [np.eye(1, 40)], np.diag([2.0 * 20.0 / 2000.0]))
    assert counted <= ENOUGH + 0.01


@pytest.mark.slow
def test_motors_that_run_tell_a_late_one_from_a_slow_one(tmp_path: Path) -> None:
    """Commands that come 0.2 s late as the truth: from themselves they are never apart; motors that lag are, by more
    nats on six targets than on two, and not at all where no motor runs."""
    body = robot()
    model = Model(nominal(body))
    replayer = Replayer(model, step=2e-3, cache_dir=tmp_path, threads=1)
    run = planted(body, {}, gaits=2, targets=2, cache_dir=tmp_path).runs[0]
    like = stretch_of(run, 1, window(run.caps, (1,), _at_rest(replayer)), 0)
    arena = Arena(replayer, [like], floor_m=2e-3)
    found = {one.effect: one for one in candidates(model) if one.element is None}

    def fit(effect: str, tau_s: float) -> Fit:
        x = np.array([tau_s])
        return Fit(
            Hypothesis((found[effect],)), arena.mean.copy(), x, np.zeros(0), np.zeros((0, 0)), 0.0, x, np.zeros(0), []
        )

    late, slow = fit("command_latency", 0.2), fit("motor_lag", 0.2)
    six = tuple(tuple(float((k + i) % 2) for i in range(6)) for k in range(6))
    still = ((1.0,) * 6,) * 6
    nats = {}
    for name, targets in {"six": six, "two": six[:2], "still": still}.items():
        found = apart(arena, imagined(arena, targets), [late, slow])
        assert np.diag(found).tolist() == [0.0, 0.0]
        nats[name] = float(found[0, 1])
    assert nats["six"] > nats["two"] > 1.0
    assert abs(nats["still"]) < 1e-2
