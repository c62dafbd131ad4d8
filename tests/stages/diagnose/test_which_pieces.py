"""Pieces of intervals: the engine's own run is predicted from where it was seen, and nothing that is unseen is lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import end_caps
from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state
from r2s2r_cli.engine.settle import window_state
from r2s2r_cli.engine.state import State, cap_velocities
from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.pieces import pieces
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.starting import Starting
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, begun_at
from r2s2r_cli.stages.diagnose.which.white import whites
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.offsets import StartSpread
from r2s2r_cli.stages.model import rest_state
from r2s2r_cli.stages.segments import Intervals, Segments
from tests.support.builders import robot

STEP, FRAME_S, SECONDS, TICK_S = 2e-3, 0.1, 3.0, 0.02
PLAY_M = 0.008
SETTLE_S = 10.0

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Walked:
    """A run of the engine with `values`, and what makes pieces of it."""

    replayer: Replayer
    model: Model
    values: np.ndarray
    run: Run
    begin: State

    @property
    def pieces(self) -> tuple[Stretch, ...]:
        """Of the one interval."""
        part = (Selection("walk", (1,)),)
        return pieces([self.run], part, {("walk", 1): self.begin}, self.replayer, self.values)

    def seen_by(
        self, place: Callable[[np.ndarray], np.ndarray], way: Callable[[np.ndarray], np.ndarray], values: np.ndarray
    ) -> Walked:
        """The same run through a camera that shows points and velocities so; values (n,) that know of it. States begin
        where the caps are seen, as those of `Starts` do."""
        caps = self.run.caps
        shown = replace(caps, observed=place(caps.observed), p_WE=place(caps.p_WE), v_WE=way(caps.v_WE))
        begin = window_state(
            self.replayer.simulator, self.model.theta(self.values), torch.as_tensor(shown.p_WE[:1]), self.begin
        )
        return replace(self, run=replace(self.run, caps=shown), values=values, begin=begin)

    def errors(self, many: tuple[Stretch, ...]) -> list[float]:
        """Largest error of a cap in each of the stretches [m]."""
        seen = self.replayer.seen(many, self.values[None])
        return [float(np.abs(s.caps[0] - one.caps).max()) for s, one in zip(seen, many, strict=True)]


@pytest.fixture(scope="module")
def walked() -> Walked:
    """Two cables in and one out again, with play in the winches; a third pays out until it hangs."""
    model = Model(nominal(robot()), effects=("backlash", "camera_delay", "camera_pose", "camera_scale"))
    replayer = Replayer(model, step=STEP, threads=1)
    values = model.values0.copy()
    for place in model.off("backlash"):
        values[place] = PLAY_M
    ticks = np.arange(0.0, SECONDS, TICK_S)
    control = np.zeros((len(ticks), 6))
    going = ticks >= 0.2
    control[:, 0] = going * np.where(ticks < 1.2, 1.0, np.where(ticks < 2.2, -1.0, 0.0))
    control[:, 1] = going * np.where(ticks < 1.0, 1.0, 0.0)
    control[:, 2] = going * np.where(ticks < 1.6, -1.0, 1.0)
    theta, structure = model.theta(values), model.structure
    base = rest_state(robot())
    start = State(
        base.p_WB, base.q_WR, base.v_WB, base.w_R, base.rest, base.winding,
        {f"{e.name}.{key}": torch.zeros(1, n) for e in structure.effects
         for key, n in e.state_sizes(structure).items()},
    )  # fmt: skip
    p = pack_parameters(structure, theta)
    still = torch.zeros(1, round(SETTLE_S / STEP), 6, dtype=torch.float64)
    settled = replayer.simulator.advance(pack_state(structure, start), still, p, h=STEP, hold=1, every=still.shape[1])
    u = torch.as_tensor(np.repeat(control, round(TICK_S / STEP), axis=0))[None]
    flat = replayer.simulator.advance(settled[:, -1], u, p, h=STEP, hold=1, every=round(FRAME_S / STEP))[0]
    states = unpack_state(structure, flat)
    caps, speed = end_caps(theta, states).numpy(), cap_velocities(theta, states).numpy()
    t = FRAME_S * np.arange(len(caps))
    last = len(t) - 1
    small = np.full(caps.shape, 1e-4)
    intervals = Intervals(
        np.array([0]), np.array([last]), np.array([0.0]), np.array([t[-1]]), np.zeros((1, 6)), np.ones(1, bool)
    )
    segments = Segments(np.array([1]), np.array([0]), np.array([last]), np.array([0.0]), np.array([t[-1]]), None,
                        np.ones(1, bool))  # fmt: skip
    quality = np.zeros(caps.shape[:2], np.uint8)
    data = RunData(
        "walk", t, caps, np.full((6, 3), 1e-4), caps, small, speed, small, quality, ticks, control,
        np.zeros_like(control), intervals, segments,
    )  # fmt: skip
    return Walked(replayer, model, values, Run(data, gait="walk"), unpack_state(structure, flat[:1]))


def test_pieces_cover_the_interval_once(walked: Walked) -> None:
    """They follow each other from frame to frame, none longer than half as much again as asked."""
    made = walked.pieces
    assert len(made) >= 3
    assert [one.piece for one in made] == list(range(len(made)))
    assert made[0].window.start == 0.0
    for one, after in pairwise(made):
        assert after.window.start == pytest.approx(one.t[-1])
    assert made[-1].t[-1] == pytest.approx(walked.run.caps.t[-1])


def test_the_engine_predicts_its_own_run(walked: Walked) -> None:
    """Begun anew in its own poses, the simulation ends where the run was: within the 3 mm by which a cable may hang
    before that is believed."""
    assert max(walked.errors(walked.pieces)) < 3.5e-3


def test_what_is_not_seen_goes_on(walked: Walked) -> None:
    """A piece that does not hear of the one before has forgotten where the winches stand in their play."""
    made = walked.pieces
    forgetful = [walked.errors((one,))[0] for one in made]
    forgetful[0] = 0.0
    values = walked.model.values0.copy()
    assert max(forgetful) <= max(walked.errors(made)) + 1e-9  # each start has the memory that `pieces` carried there
    without = Walked(walked.replayer, walked.model, values, walked.run, walked.begin)
    assert max(without.errors(without.pieces)) > 3e-3


def test_hypotheses_carry_their_own_memory(walked: Walked) -> None:
    """Pieces cut at the nominal numbers, replayed with the play that was planted: as good as pieces that were cut with
    it, because every hypothesis hands its own memory on."""
    cut = Walked(walked.replayer, walked.model, walked.model.values0, walked.run, walked.begin).pieces
    chained = walked.errors(cut)
    alone = [walked.errors((one,))[0] for one in cut]
    assert max(chained) < 8e-3
    assert max(alone) > 1.5 * max(chained)


def test_a_hanging_cable_hangs_on(walked: Walked) -> None:
    """A cable that paid out is longer than one that is just taut at the start of a later piece."""
    hanging = [
        float(one.window.state.rest[0, 2] - one.taut[2]) for one in walked.pieces[1:] if one.taut is not None
    ]  # fmt: skip
    assert len(hanging) >= 2
    assert max(hanging) > 0.01


def test_a_camera_that_shows_the_robot_elsewhere_is_told_from_a_robot_that_is_there(walked: Walked) -> None:
    """Caps seen through a turned, shifted, wrongly scaled camera: with its numbers as good as without it."""
    turn, shift, scale = 0.05, np.array([0.02, -0.01, 0.0]), 1.02
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    values = walked.values.copy()
    numbers = {"camera_pose.turn_z_rad": turn, "camera_pose.shift_x_m": shift[0], "camera_pose.shift_y_m": shift[1]}
    for name, value in numbers.items():
        values[walked.model.place[name]] = value
    turned = walked.seen_by(lambda p: p @ R.T + shift, lambda v: v @ R.T, values)
    assert max(turned.errors(turned.pieces)) < 3.5e-3
    values = walked.values.copy()
    values[walked.model.place["camera_scale.factor"]] = scale
    scaled = walked.seen_by(lambda p: scale * p, lambda v: scale * v, values)
    cut = scaled.pieces
    plain = replace(scaled, values=walked.values)
    assert max(scaled.errors(cut)) < 6e-3
    assert np.mean(scaled.errors(cut)) < 0.5 * np.mean(plain.errors(plain.pieces))


def test_offsets_of_a_start_move_what_is_seen(walked: Walked) -> None:
    """Without an offset the same as ever; a rod put 2 mm along x moves its own caps by that at first; one that moves
    faster is farther off the later it is."""
    one = walked.pieces[-1]
    by = np.zeros((43, 42))
    by[1, 0], by[19, 18] = 2e-3, 0.02  # place and velocity of rod 0 along x
    values = np.repeat(walked.values[None], 43, axis=0)
    (around,) = walked.replayer.around([one], values, [by])
    (alike,) = walked.replayer.seen([replace(one, piece=0)], values, [by])
    assert np.array_equal(alike.caps, around.caps) and np.array_equal(alike.length, around.length)
    (seen,) = walked.replayer.seen([replace(one, piece=0)], walked.values[None])
    assert np.array_equal(around.caps[0], seen.caps[0]) and np.array_equal(around.length[0], seen.length[0])
    still = [k for k in range(42) if k not in (0, 18)]
    assert np.array_equal(around.caps[1:][still], np.broadcast_to(seen.caps, (40, *seen.caps.shape[1:])))
    moved = np.abs(around.caps - around.caps[:1]).max(axis=(2, 3))
    assert 1e-4 < moved[1, 0] < 4e-3
    assert moved[19].max() > 1e-4


def test_a_stretch_that_begins_elsewhere_is_one_that_was_moved(walked: Walked) -> None:
    """Offsets in a question and offsets in the stretch itself are the same, also of cables that a piece before it
    hands on."""
    before, one = walked.pieces[-2:]
    by = 1e-3 * np.random.default_rng(0).standard_normal(42)
    structure = walked.replayer.structure
    asked = walked.replayer.seen([before, one], walked.values[None], [np.zeros((1, 42)), by[None]])
    moved = walked.replayer.seen([before, begun_at(structure, one, by)], walked.values[None])
    for a, b in zip(asked, moved, strict=True):
        assert a.caps == pytest.approx(b.caps, abs=1e-9) and a.length == pytest.approx(b.length, abs=1e-9)
    assert np.abs(asked[1].caps - walked.replayer.seen([before, one], walked.values[None])[1].caps).max() > 3e-4


def test_a_late_camera_shows_what_was(walked: Walked) -> None:
    """Caps of `tau` ago, while the sensors read the present."""
    tau = 0.1
    whole = walked.pieces[:1]
    values = np.repeat(walked.values[None], 2, axis=0)
    values[1, walked.model.off("camera_delay")[0]] = tau
    seen = walked.replayer.seen(whole, values)[0]
    frames = round(tau / FRAME_S)
    assert seen.caps[1, frames:] == pytest.approx(seen.caps[0, :-frames], abs=1e-3)
    assert np.abs(seen.caps[1] - seen.caps[0]).max() > 3e-3


def test_a_piece_is_told_where_the_one_before_ended(walked: Walked) -> None:
    """In offsets of its own start: small where it was seen right, and what it was seen wrong by otherwise."""
    made, structure = walked.pieces, walked.replayer.structure
    starting = Starting(structure, made)
    assert starting.before == [None, *range(len(made) - 1)]
    each = starting.tried()
    starting.learn(walked.replayer.around(made, np.repeat(walked.values[None], len(each[0]), axis=0), each))

    def ended(many: tuple[Stretch, ...]) -> np.ndarray:
        seen = walked.replayer.seen(many, walked.values[None])
        return starting.ahead(1, seen[1], seen[0])[0] * made[1].start_sd

    rods = structure.n_rods
    assert np.abs(ended(made)[: 3 * rods]).max() < 3.5e-3
    wrong = np.zeros(starting.offsets)
    wrong[: 3 * rods : 3] = 1e-3  # to the side
    wrong[3 * rods] = 0.01  # a tilt of the first rod
    shifted = (made[0], begun_at(structure, made[1], wrong), *made[2:])
    assert ended(shifted) - ended(made) == pytest.approx(-wrong, abs=2e-4)


def test_the_start_of_a_piece_is_known_from_the_frames_before(walked: Walked) -> None:
    """Under 3 mm of noise better than from where it was seen alone; a run of its own has nothing before it."""
    spread, values = StartSpread().sd(walked.replayer.structure), walked.values
    made = tuple(replace(one, start_sd=spread, noise=np.full_like(one.noise, 3e-3)) for one in walked.pieces)
    starting = Starting(walked.replayer.structure, made)
    each = starting.tried()
    starting.learn(walked.replayer.around(made, np.repeat(values[None], len(each[0]), axis=0), each))
    white = whites(made, starting.by_start, starting.ways, sensors=0, floor_m=1e-4, noise=1.0, lasts=0.0)
    places = 3 * walked.replayer.structure.n_rods
    link = white[1].kinds[0].link
    assert white[0].kinds[0].link is None and link is not None
    sd = np.sqrt(np.diag(link.root @ link.root.T))[:places]
    assert sd.mean() < 0.8
    stranger = (replace(made[0], run="another"), *made[1:])
    assert Starting(walked.replayer.structure, stranger).before[:2] == [None, None]
