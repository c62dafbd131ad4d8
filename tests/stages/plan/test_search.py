"""The search: what is told of like poses is what the simulator says, and robust gaits win."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.plan.alike import alike, carried, told_targets
from r2s2r_cli.stages.plan.gaits import Gait, neighbours, run_gaits
from r2s2r_cli.stages.plan.placement import turned
from r2s2r_cli.stages.plan.rewards import BEHAVIOURS, Outcomes, reward_named
from r2s2r_cli.stages.plan.robust import primitive, usual_ends
from r2s2r_cli.stages.plan.search import Found, Search, SearchSettings, best_of
from tests.stages.plan.planted import bench


def searched(**options: float) -> Found:
    """Gaits of two shapes that switch one or two cables at a time."""
    executor, reference, at = bench()
    settings = SearchSettings(depth=3, most_changed=1, **options)  # type: ignore[arg-type]
    return Search(executor, reference, at, BEHAVIOURS, settings).found()


def outcome(**columns: list[float]) -> Outcomes:
    """Made-up outcomes: forward displacements and turns."""
    n = len(next(iter(columns.values())))
    com = np.zeros((n, 3))
    com[:, 1] = columns.get("forward", [0.0] * n)
    zero = np.zeros(n)
    return Outcomes(com, np.array(columns.get("turn", zero)), np.array(columns.get("element", zero), dtype=int), zero,
                    zero + 4.0, np.array(columns.get("switched", zero)))  # fmt: skip


def test_the_shapes_next_to_one() -> None:
    """Six cables have 62 other shapes than rest next to rest and 6 with one cable switched; all binary, none twice."""
    rest = np.ones(6)
    assert len(neighbours(rest, 6)) == 63 and len(neighbours(rest, 1)) == 6
    bent = np.array([1.0, 0, 1, 1, 0, 1])
    every = neighbours(bent, 6)
    assert len(every) == 62 and len(np.unique(every, axis=0)) == 62
    assert not (every == bent).all(axis=1).any() and not (every == 1).all(axis=1).any()


def relabelled_and_moved(points: np.ndarray, yaw: float, shift: np.ndarray, caps: tuple[int, ...]) -> np.ndarray:
    """Caps and further points (n, 3), turned about the vertical, shifted, the caps relabelled."""
    flat = np.concatenate([turned(points[:, :2], yaw) + shift, points[:, 2:]], axis=1)
    made = flat.copy()
    made[list(caps)] = flat[:6]
    return made


def test_like_poses_are_told_their_future() -> None:
    """A pose, and the same relabelled, moved and turned: one class; the leader's future told of the member is that of
    the member, point by point and target by target."""
    _, reference, _ = bench()
    group, generator = reference.group, np.random.default_rng(1)
    pose, future = generator.normal(size=(6, 3)), generator.normal(size=(7, 3))
    shape, after = np.array([1.0, 0, 1, 1, 0, 0]), np.array([0.0, 0, 1, 1, 1, 0])
    poses, futures, shapes, afters = [pose], [future], [shape], [after]
    for k in range(1, len(group)):
        g = group.elements[k]
        yaw, shift = float(generator.uniform(-3, 3)), generator.normal(size=2)
        poses.append(relabelled_and_moved(pose, yaw, shift, g.caps))
        futures.append(relabelled_and_moved(future, yaw, shift, g.caps))
        shapes.append(g.relabelled(shape))
        afters.append(g.relabelled(after))
    p, f = np.array(poses), np.array(futures)
    same = alike(group, np.array(shapes), p, np.zeros((6, 6)), 1e-6)
    assert same.leader.tolist() == [0] * 6
    assert np.allclose(carried(group, same, p, np.arange(6), np.repeat(f[:1], 6, axis=0)), f, atol=1e-9)
    assert (told_targets(group, same, np.arange(6), np.repeat(afters[:1], 6, axis=0)) == np.array(afters)).all()
    apart = alike(group, np.array(shapes), p * np.array([1.0, 1.0, 1.1]), np.zeros((6, 6)), 1e-6)
    assert apart.leader.tolist() == [0] * 6  # all stretched alike: still one class
    p[3, 0, 2] += 0.1
    assert alike(group, np.array(shapes), p, np.zeros((6, 6)), 1e-6).leader.tolist() == [0, 0, 0, 3, 0, 0]


@pytest.mark.slow
def test_every_gait_of_the_search_is_what_the_simulator_says() -> None:
    """Gaits that were only told, simulated: the same displacement to the size of the classes, the same triangle; with
    classes fewer targets are simulated."""
    executor, reference, at = bench()
    plain, merged = searched(merge_m=0.0), searched(merge_m=0.006)
    assert merged.simulated < plain.simulated
    assert {gait.key for gait in merged.gaits} == {gait.key for gait in plain.gaits}
    for found, slack in ((plain, 1e-9), (merged, 0.01)):
        came, sound = run_gaits(executor, reference, at, found.gaits, np.zeros(len(found.gaits), dtype=int))
        assert sound.all()
        assert np.abs(came.com - found.outcomes.com).max() < slack
        assert (came.element == found.outcomes.element).all()
        assert np.allclose(came.duration, found.outcomes.duration, atol=0.1)


def test_a_beam_leaves_classes_behind() -> None:
    """With a beam fewer poses go on, and what is found is part of all there is."""
    whole, narrow = searched(), searched(beam=2)
    assert narrow.pruned > 0 and narrow.simulated < whole.simulated
    assert {gait.key for gait in narrow.gaits} < {gait.key for gait in whole.gaits}


def test_the_best_are_the_best_and_no_outcome_twice() -> None:
    """Sorted by reward; of equal outcomes the gait that switches fewest cables."""
    rest = np.ones((1, 6))
    gaits = [Gait(np.concatenate([np.tile(row, (1, 1)), rest])) for row in np.eye(6)[[0, 1, 2, 3]]]
    found = Found(gaits, outcome(forward=[0.1, 0.3, 0.3, 0.2], switched=[2, 8, 4, 2]), 0, 0, 0)
    assert best_of(found, BEHAVIOURS["forward"], 3) == [2, 3, 0]
    assert best_of(found, BEHAVIOURS["backward"], 1) == [0]


def test_a_gait_that_works_in_one_simulator_only_loses() -> None:
    """0.3 m with one draw and nothing with the others scores below 0.1 m with all; failures earn nothing."""
    gait, reward = Gait(np.ones((1, 6))), BEHAVIOURS["forward"]
    everywhere = np.ones(4, dtype=bool)
    lucky = primitive("a", "forward", reward, gait, outcome(forward=[0.3, 0, 0, 0]), everywhere, spread=1.0)
    steady = primitive("b", "forward", reward, gait, outcome(forward=[0.1, 0.1, 0.11, 0.09]), everywhere, spread=1.0)
    assert lucky.nominal > steady.nominal and lucky.score < steady.score
    assert np.isclose(lucky.mean, 0.075) and np.isclose(lucky.sd, 0.3 * np.sqrt(3) / 4)
    broken = primitive("c", "forward", reward, gait, outcome(forward=[0.3] * 4), np.array([True, False, False, True]),
                       spread=1.0)  # fmt: skip
    assert np.isclose(broken.mean, 0.15) and broken.worked == 0.5


def test_a_gait_on_the_brink_of_tipping_is_not_steady() -> None:
    """Ends in two heaps: those far from the median are astray, whatever they earn; scatter of the size of a gait is
    not, nor the side of half a turn on which an angle lies."""
    gait, reward, good = Gait(np.ones((1, 6))), BEHAVIOURS["forward"], np.ones(5, dtype=bool)
    brink = primitive("a", "forward", reward, gait, outcome(forward=[0.3, 0.3, 0.31, 0.1, 0.45]), good, spread=1.0)
    assert np.isclose(brink.same_element, 0.6) and np.isclose(brink.move[1], 0.91 / 3) and brink.worked == 1.0
    apart = primitive("b", "forward", reward, gait, outcome(forward=[0.3, 0.28, 0.33, 0.26, 0.31]), good, spread=1.0)
    assert apart.same_element == 1.0
    turns = np.array([[0.0, 0.0, np.pi - 0.01], [0.0, 0.0, -np.pi + 0.01], [0.0, 0.0, np.pi - 0.02], [0.0, 0.0, 1.0]])
    assert usual_ends(turns).tolist() == [True, True, True, False]


@pytest.mark.parametrize("degrees", [[178, 179, -179, -178, 180], [-178, -179, 178, 177], [90, 92, 88], [-3, 4, -1]])
def test_a_gait_of_half_a_turn_turns_by_half_a_turn(degrees: list[float]) -> None:
    """Mean and scatter are those of the directions, on whichever side of half a turn they lie; others as they were."""
    turn = np.radians(np.array(degrees, dtype=float))
    came = outcome(forward=[0.1] * len(turn), turn=turn.tolist())
    made = primitive("a", "forward", BEHAVIOURS["forward"], Gait(np.ones((1, 6))), came, turn < 9.0, spread=1.0)
    seen = turn % (2 * np.pi) if np.abs(turn).max() > 3 else turn
    assert made.same_element == 1.0
    assert np.isclose(np.cos(made.move[2] - seen.mean()), 1.0) and abs(made.move[2]) <= np.pi
    assert np.isclose(made.move_sd[2], seen.std())
    if np.abs(turn).max() < 3:
        assert made.move[2] == turn.mean()


@pytest.mark.parametrize(
    ("degrees", "mean", "sd"),
    [
        ([179, -179, 180, 178], 179.5, 1.118),
        ([90, 92, 88], 90, 1.633),
        ([170, -160, 20], -110, 92.74),  # most turn by 185, which is -175: by -190 and -160
        ([100, -100], 0, 100),
    ],
)
def test_a_gait_is_rewarded_for_half_a_turn(degrees: list[float], mean: float, sd: float) -> None:
    """Ends on both sides of half a turn are one turn, whichever way it is rewarded, where they lie together; ends all
    over the place are rewarded as they are."""
    turn = np.radians(np.array(degrees, dtype=float))
    came, everywhere = outcome(turn=turn.tolist()), np.ones(len(turn), dtype=bool)
    for behaviour, sign in (("counterclockwise", 1.0), ("clockwise", -1.0)):
        reward = BEHAVIOURS[behaviour]
        made = primitive("a", behaviour, reward, Gait(np.ones((1, 6))), came, everywhere, spread=1.0)
        assert np.allclose(np.degrees([made.mean, made.sd]), [sign * mean, sd], atol=0.1)
        assert np.isclose(made.score, made.mean - made.sd)


def sideways(came: Outcomes) -> np.ndarray:
    """A user's reward: along the principal axis."""
    return came.com[:, 0]


def test_rewards_of_users() -> None:
    """A dotted name is loaded and judged like the four of the paper; what is no reward is said."""
    came = outcome(forward=[0.1, 0.2])
    mine = reward_named(f"{__name__}:sideways")
    assert (mine(came) == 0).all() and (reward_named("backward")(came) == [-0.1, -0.2]).all()
    for wrong in ("upwards", f"{__name__}:nothing", f"{__name__}:BEHAVIOURS"):
        with pytest.raises(UsageError):
            reward_named(wrong)
    with pytest.raises(UsageError, match="no number"):
        reward_named("builtins:len")(came)
