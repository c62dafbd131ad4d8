"""Start states of a simulated run whose truth is known: nearer to it than the frames, causal, the same every time."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import State, end_caps
from r2s2r_cli.engine.flat import pack_state
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.belief import Filter
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.free import Mapping, select
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.start import start_states
from r2s2r_cli.stages.segments import Intervals, Segments
from tests.support.robots import subject

SPEED = np.array([0.7])
NOISE, JUMP = 2e-3, 0.03
"""[m]"""
FRAME, EACH, COUNT = 0.05, 20, 3
"""[s], frames an interval, intervals."""
OFF, WHILE = 4, range(34, 46)
"""A cap that jumps for 12 frames; interval 3 starts amid them."""
CONTROL = np.array([[1.0, 0, 0, 0, -1, 0], [-1, 1, 0, 0, 1, 0], [0, -1, 1, 0, 0, 1]])
WHITE = Filter(members=32, noise=NOISE, persistence=0.0)
"""What is true of this run's noise."""


@lru_cache
def predictor(name: str = "threebar") -> Predictor:
    """Of a robot, with its motor speed free; compiled once a test session."""
    made = Predictor(Mapping(subject(name).robot, select(["motor_speed"], subject(name).robot)), threads=1)
    assert made.structure == subject(name).structure
    made.simulator = subject(name).simulator
    return made


@lru_cache
def control(name: str) -> np.ndarray:
    """Commands of the intervals (interval, actuated): those of every further six winches are the same."""
    return np.tile(CONTROL, predictor(name).structure.n_actuated // 6)


@lru_cache
def truth(name: str = "threebar") -> tuple[np.ndarray, tuple[State, ...]]:
    """End caps at all frames (frame, cap, 3) [m], and states at the starts of the intervals."""
    u = torch.as_tensor(np.repeat(control(name), EACH, axis=0))[None]
    hold, theta = round(FRAME / 1e-3), predictor(name).mapping.theta(SPEED)
    start = subject(name).settle(subject(name).p_WE).state
    path = predictor(name).simulator.rollout(theta, start, u, hold=hold, every=hold)
    return path.end_caps()[0].numpy(), tuple(path.at(EACH * k) for k in range(COUNT))


@lru_cache
def run(name: str = "threebar") -> RunData:
    """The truth with white noise, and with one cap off for a while."""
    p_WE, _ = truth(name)
    observed = p_WE + NOISE * np.random.default_rng(0).normal(size=p_WE.shape)
    observed[WHILE, OFF, 0] += JUMP
    first = EACH * np.arange(COUNT)
    last = first + EACH
    t = 3.0 + FRAME * np.arange(len(p_WE))
    commands, none = control(name), np.zeros_like(p_WE)
    intervals = Intervals(first, last, t[first], t[last], np.zeros_like(commands), np.ones(COUNT, bool))
    segments = Segments(np.arange(COUNT) + 1, first, last, t[first], t[last], None, np.ones(COUNT, bool))
    return RunData(
        name="made", t=t, observed=observed, noise=np.full(p_WE.shape[1:], NOISE), p_WE=none, sd_p=none, v_WE=none,
        sd_v=none, quality=np.zeros(p_WE.shape[:2], np.uint8), t_command=t[first], control=commands,
        target=np.zeros_like(commands), intervals=intervals, segments=segments,
    )  # fmt: skip


@lru_cache
def found(name: str = "threebar") -> tuple[State, ...]:
    """Start states of the three intervals."""
    return tuple(start_states(run(name), predictor(name), SPEED, COUNT, belief=WHITE))


def bits(states: list[State] | tuple[State, ...]) -> list[bytes]:
    """Of the flat states."""
    return [pack_state(predictor().structure, state).numpy().tobytes() for state in states]


def rms(off: np.ndarray) -> float:
    """Of distances, (cap, 3) [m]."""
    return float(np.sqrt((off**2).sum(-1).mean()))


def gain(name: str, k: int) -> float:
    """Error of the observed caps at the start of interval k + 1 over that of the start state's."""
    caps = end_caps(predictor(name).mapping.theta(SPEED), found(name)[k])[0].numpy()
    frame = EACH * k
    return rms(run(name).observed[frame] - truth(name)[0][frame]) / rms(caps - truth(name)[0][frame])


def test_starts_are_nearer_to_the_truth_than_the_frames() -> None:
    """By a factor of 2 where all caps are well, and of 4 where one is 30 mm off."""
    assert gain("threebar", 1) > 2 and gain("threebar", 2) > 4


@pytest.mark.slow
def test_another_robot() -> None:
    """Six rods and twelve winches: the same where one cap is off, and no worse than the frames where all are well."""
    assert gain("sixbar", 1) > 1 and gain("sixbar", 2) > 3


def test_a_filter_that_expects_a_worse_tracker() -> None:
    """As it comes, it holds errors for lasting ones, follows the frames less, and halves the error of the jump."""
    theta, frame = predictor().mapping.theta(SPEED), EACH * 2
    caps = end_caps(theta, start_states(run(), predictor(), SPEED, COUNT)[2])[0].numpy()
    assert rms(caps - truth()[0][frame]) < rms(run().observed[frame] - truth()[0][frame]) / 2


def test_a_cap_that_is_hidden_counts_as_little_as_it_is_known() -> None:
    """The frames in which one cap is off say that it is only known to 0.3 m: it pulls nobody any more, and the start
    behind them is nearer to the truth, Gaussian errors or not."""
    belief = replace(WHITE, dof=1e9, members=16)
    sd = np.zeros_like(run().observed)
    sd[WHILE, OFF] = 0.3
    frame, theta = EACH * 2, predictor().mapping.theta(SPEED)
    off = []
    for one in (run(), replace(run(), observed_sd=sd)):
        caps = end_caps(theta, start_states(one, predictor(), SPEED, COUNT, belief=belief)[2])[0].numpy()
        off.append(rms(caps - truth()[0][frame]))
    assert off[1] < off[0] / 2


@pytest.mark.parametrize("lost", [1, 20])
def test_members_that_leave_the_finite_numbers(lost: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of 32 is stood in for by another, and the starts are as near to the truth as before; most of them are the
    simulator's fault, which is said."""
    own = type(predictor().simulator)
    plain, first = own.advance, []
    belief = replace(WHITE, seed=lost)  # starts that were asked for before are kept

    def advance(self: object, flat: torch.Tensor, *args: object, **how: object) -> torch.Tensor:
        found: torch.Tensor = plain(self, flat, *args, **how)  # type: ignore[arg-type]
        if not first and len(found) == WHITE.members:
            first.append(True)
            found = found.clone()
            found[:lost, -1] = torch.nan
        return found

    monkeypatch.setattr(own, "advance", advance)
    if lost > WHITE.members / 2:
        with pytest.raises(NumericalError, match="finite numbers"):
            start_states(run(), predictor(), SPEED, COUNT, belief=belief)
        return
    states = start_states(run(), predictor(), SPEED, COUNT, belief=belief)
    assert first
    for k in (1, 2):
        away = rms(end_caps(predictor().mapping.theta(SPEED), states[k])[0].numpy() - truth()[0][EACH * k])
        assert away < rms(run().observed[EACH * k] - truth()[0][EACH * k])


def test_what_no_frame_shows() -> None:
    """Rest lengths come out to 3 mm where the winches wound by 50 mm, and velocities of rods to 3 cm/s."""
    for k in (1, 2):
        assert float((found()[k].rest - truth()[1][k].rest).abs().max()) < 3e-3
        assert float((found()[k].v_WB - truth()[1][k].v_WB).abs().max()) < 3e-2


def test_the_first_start_is_the_robot_at_rest() -> None:
    """No velocity, the middle of the caps where it was seen, whatever the filter believes."""
    assert not found()[0].v_WB.any() and not found()[0].w_R.any()
    assert bits(found()[:1]) == bits(start_states(run(), predictor(), SPEED, 1, belief=Filter(members=3, seed=8)))
    theta = predictor().mapping.theta(SPEED)
    middle = end_caps(theta, found()[0])[0].numpy().mean(axis=0) - run().observed[0].mean(axis=0)
    assert np.abs(middle[:2]).max() < NOISE


def test_later_frames_change_no_bit() -> None:
    """Frames after the start of interval 2 thrown about by decimetres: states 1 and 2 stay, state 3 does not."""
    later = run().observed.copy()
    later[EACH + 1 :] += np.random.default_rng(1).normal(scale=0.1, size=later[EACH + 1 :].shape)
    other = start_states(replace(run(), observed=later), predictor(), SPEED, COUNT, belief=WHITE)
    assert bits(other[:2]) == bits(found()[:2])
    assert bits(other[2:]) != bits(found()[2:])


def test_one_seed_one_result() -> None:
    """Fewer intervals and another call give the same bits, another seed gives others, no further off than the noise."""
    whole = bits(found())
    predictor().ways.clear()
    assert bits(start_states(run(), predictor(), SPEED, 2, belief=WHITE)) == whole[:2]
    other = start_states(run(), predictor(), SPEED, 2, belief=replace(WHITE, seed=1))
    assert bits(other[1:]) != bits(found()[1:2])
    assert other[1].p_WB.numpy() == pytest.approx(found()[1].p_WB.numpy(), abs=NOISE)


def test_what_was_found_is_not_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for more intervals, the filter goes on, with the bits of one that was asked for all at once; asked for
    fewer, nothing is simulated. Other values, frames or beliefs begin anew."""
    whole = bits(found())
    predictor().ways.clear()
    asked = [start_states(run(), predictor(), SPEED, count, belief=WHITE) for count in (1, COUNT)]
    assert bits(asked[0]) == whole[:1] and bits(asked[1]) == whole

    def advance(*args: object, **options: object) -> None:
        raise AssertionError

    monkeypatch.setattr(predictor().simulator, "advance", advance)
    assert bits(start_states(run(), predictor(), SPEED, 2, belief=WHITE)) == whole[:2]
    kept = dict(predictor().ways)
    for other in (
        {"values": 1.01 * SPEED}, {"run": replace(run())}, {"belief": replace(WHITE, seed=1)},
    ):  # fmt: skip
        predictor().ways.update(kept)
        given = {"run": run(), "values": SPEED, "belief": WHITE, **other}
        with pytest.raises(AssertionError):
            start_states(given["run"], predictor(), given["values"], 2, belief=given["belief"])  # type: ignore[arg-type]
        assert not predictor().ways
