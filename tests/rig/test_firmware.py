"""The boards: what they measure against the truth, when, and by which clock."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.rig.firmware import BoardSample
from r2s2r_cli.rig.firmware.board import Board
from r2s2r_cli.rig.firmware.generators import generator
from r2s2r_cli.rig.firmware.inertial import InertialUnit
from r2s2r_cli.rig.firmware.layout import Post, posts
from r2s2r_cli.rig.world import Boards, Inertial, World
from tests.support.rig_boards import ALL, GAIT, ROBOT, TICK, lengths_of, make, run
from tests.support.rig_robots import known


def test_a_board_at_rest_weighs_g_and_does_not_turn() -> None:
    """Mean of many readings at rest: 9.81 m/s^2 upwards and no turn, but for the biases of the seed."""
    quiet = Inertial(accel_bias_sd_m_per_s2=0.0, gyro_bias_sd_rad_per_s=0.0)
    unit = InertialUnit(quiet, np.random.default_rng(0))
    q = np.array([0.0, np.sin(0.3), 0.0, np.cos(0.3)])
    read = [unit.read(0.02 * k, q, np.zeros(3), np.zeros(3)) for k in range(400)]
    a, w = np.mean([r[0] for r in read], axis=0), np.mean([r[1] for r in read], axis=0)
    np.testing.assert_allclose(a, 9.81 * np.array([-np.sin(0.6), 0.0, np.cos(0.6)]), atol=0.01)
    np.testing.assert_allclose(w, 0.0, atol=1e-3)
    biased = [
        InertialUnit(Inertial(), np.random.default_rng(i)).read(0, q, np.zeros(3), np.zeros(3))[0] for i in range(200)
    ]
    assert np.std(np.array(biased), axis=0) == pytest.approx(0.4, rel=0.2)


def test_an_accelerated_board_feels_it() -> None:
    """Specific force is the change of velocity over the time between two readings, minus gravity."""
    unit = InertialUnit(Inertial(accel_bias_sd_m_per_s2=0.0, accel_noise_sd_m_per_s2=0.0), np.random.default_rng(0))
    level = np.array([0.0, 0.0, 0.0, 1.0])
    unit.read(0.0, level, np.zeros(3), np.zeros(3))
    a, _, _ = unit.read(0.1, level, np.array([0.2, 0.0, -0.981]), np.zeros(3))
    np.testing.assert_allclose(a, [2.0, 0.0, 0.0], atol=1e-12)


def test_reckoned_attitude_drifts_about_the_vertical() -> None:
    """After t seconds it is turned by rate t about the world's z axis."""
    unit = InertialUnit(Inertial(yaw_drift_rad_per_s=0.01), np.random.default_rng(0))
    _, _, q = unit.read(100.0, np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(q, [np.cos(0.5), np.sin(0.5), 0.0, 0.0], atol=1e-12)


def test_three_boards_share_the_work_and_one_has_it_all() -> None:
    """Every sensor and motor belongs to exactly one board, in both layouts and on another robot."""
    for robot in (ROBOT, known("threebar-330"), known("sixbar")):
        for layout, count in (("per_rod", len(robot.rods)), ("central", 1)):
            boards = posts(robot, layout)  # type: ignore[arg-type]
            assert len(boards) == count
            assert sorted(i for b in boards for i in b.sensors) == list(range(len(robot.sensors)))
            assert sorted(i for b in boards for i in b.motors) == list(range(len(robot.motors)))


def test_each_board_sends_its_own_at_its_own_pace() -> None:
    """About 50 samples a second from each, not together; NaN where a board measures nothing."""
    firmware, _ = make()
    samples = run(firmware, 2.0)
    for number, post in enumerate(posts(ROBOT, "per_rod")):
        mine = [s for s in samples if s.board == number]
        assert len(mine) == pytest.approx(100, abs=4)
        seen = np.isfinite(np.array([s.pF for s in mine]))
        assert (seen == np.isin(ALL, post.sensors)).all()
        assert (np.isfinite(mine[0].encoder) == np.isin(range(6), post.motors)).all()
        gaps = np.diff([s.t for s in mine])
        assert 0.012 < gaps.min() < gaps.max() < 0.028
    assert (np.diff([s.t for s in samples]) > 0).all()


def test_a_board_of_the_widest_spread_still_goes_on() -> None:
    """Whatever is drawn, a board samples forwards: one with a rate below 0 went back in time for ever."""
    rates = Boards(rate_spread=0.3)
    for seed in range(100):
        world = World(seed=seed, boards=rates)
        board = Board(0, Post(0, (), ()), world, generator(world, "board 0"))
        before = board.due
        board.sampled()
        assert board.due > before


def test_recorded_lengths_are_the_true_ones_within_the_stated_error() -> None:
    """Sensors of the world's defaults, read through the calibration during a gait: within four standard deviations of
    day, bow, noise, one count of the converter, and what the cable moved within the lag."""
    firmware, plant = make(seed=4)
    firmware.command(GAIT, 0.0)
    worst = np.zeros(9)
    for k in range(1, 76):
        before = plant.lengths()
        for sample in firmware.tick(k * TICK):
            moved = np.abs(plant.lengths() - before).max() / TICK * 0.05
            error = np.abs(lengths_of(sample.pF) - plant.lengths()) - moved
            worst = np.fmax(worst, error)
    sd = np.sqrt(0.005**2 + 0.002**2 + 0.0005**2 + 0.001**2)
    assert (worst < 4 * sd).all()
    assert worst.max() > 0.002


def test_encoders_count_the_turns_of_the_wire() -> None:
    """1800 counts a turn, positive for a positive duty."""
    firmware, plant = make()
    firmware.command(GAIT, 0.0)
    samples = run(firmware, 0.5)
    last = np.nanmax([s.encoder for s in samples[-6:]], axis=0)
    turns = plant.truth().angle / (2 * np.pi)
    np.testing.assert_allclose(last[[0, 2]], 1800 * turns[[0, 2]], rtol=0.06)
    assert last[4] < 0 == last[1]


def test_commands_are_cut_to_whole_steps_of_the_range() -> None:
    """A duty beyond 1 is 1, one between two steps is the smaller, NaN keeps what was, and a whole step stays itself."""
    firmware, _ = make()
    firmware.command(np.array([1.7, -2.0, 0.5, 1.0 / 255, 0.9 / 255, 0.0]), 0.0)
    np.testing.assert_allclose(firmware.duty * 255, [255, -255, 127, 1, 0, 0], atol=1e-9)
    firmware.command(np.array([np.nan, 0.0, np.nan, np.nan, np.nan, np.nan]), 0.0)
    np.testing.assert_allclose(firmware.duty * 255, [255, 0, 127, 1, 0, 0], atol=1e-9)
    for n in range(256):
        firmware.command(np.full(6, n / 255), 0.0)
        assert firmware.duty[0] == n / 255
    firmware.stop()
    assert (firmware.duty == 0).all()


def test_a_command_of_the_future_waits_for_its_time() -> None:
    """It holds from its own instant on, to within a step, and a stop forgets it."""
    firmware, plant = make()
    firmware.command(np.full(6, 0.5), 0.05)
    firmware.tick(0.04)
    assert (plant.truth().angle == 0).all()
    firmware.tick(0.1)
    np.testing.assert_allclose(plant.truth().angle / plant.winches._full / firmware.duty[0], 0.05, atol=0.0011)
    firmware.command(np.full(6, -0.5), 0.2)
    firmware.stop()
    firmware.tick(0.3)
    assert (firmware.duty == 0).all()


def test_how_ticks_are_cut_does_not_matter() -> None:
    """One tick of 0.4 s gives the samples of twenty of 20 ms; what differs is less than a step."""
    table = {"converter": "exact"}
    (a, _), (b, _) = make(seed=2, sensors=table), make(seed=2, sensors=table)
    whole, parts = a.tick(0.4), run(b, 0.4)
    assert [s.board for s in whole] == [s.board for s in parts]
    for one, other in zip(whole, parts, strict=True):
        assert one.t == other.t
        np.testing.assert_allclose(one.pF, other.pF, atol=5e-3)


def test_same_seed_same_samples_and_another_seed_others() -> None:
    """Lock-step is deterministic: two runs agree in every field to the last bit."""

    def samples(seed: int) -> list[BoardSample]:
        firmware, _ = make(seed=seed)
        firmware.command(GAIT, 0.0)
        return run(firmware, 0.4)

    one, two, other = samples(1), samples(1), samples(2)
    for a, b in zip(one, two, strict=True):
        for field in fields(BoardSample):
            np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))
    assert [s.t_board for s in one[:5]] != [s.t_board for s in other[:5]]


def test_clocks_run_each_on_their_own() -> None:
    """Each starts elsewhere, runs a little wrong, and counts whole microseconds; a jump is a jump."""
    firmware, _ = make(faults=[{"kind": "clock_jump", "board": 1, "at_s": 1.0, "by_s": 5.0}])
    for board in range(3):
        elapsed = firmware.clock(board, 1001.0) - firmware.clock(board, 1.0)
        assert elapsed == pytest.approx(1000.0, abs=0.2)
        assert elapsed != 1000.0
    assert len({round(firmware.clock(b, 0.0)) for b in range(3)}) == 3
    assert firmware.clock(1, 1.0) - firmware.clock(1, 0.999) == pytest.approx(5.001, abs=1e-4)
    assert firmware.clock(2, 1.0) - firmware.clock(2, 0.999) == pytest.approx(0.001, abs=2e-6)


def test_a_silent_board_keeps_its_motors() -> None:
    """It sends nothing for its time, and its motors run on: the authors' boards have no watchdog."""
    firmware, plant = make(faults=[{"kind": "board_silent", "board": 2, "at_s": 0.2, "for_s": 0.5}])
    firmware.command(np.array([0.5, 0, 0, 0, 0, 0]), 0.0)
    samples = run(firmware, 1.0)
    times = [s.t for s in samples if s.board == 2]
    assert not [t for t in times if 0.2 <= t < 0.7]
    assert np.diff(times).max() == pytest.approx(0.5, abs=0.04)
    assert plant.truth().angle[0] / plant.winches._full[0] == pytest.approx(0.5, rel=0.01)


def test_a_reset_board_forgets_everything() -> None:
    """Its motors stop, it neither sends nor obeys, then it greets once, and its clock begins anew."""
    firmware, plant = make(faults=[{"kind": "board_reset", "board": 2, "at_s": 0.2, "for_s": 0.3}])
    firmware.command(np.array([0.5, 0.5, 0, 0, 0, 0]), 0.0)
    samples = run(firmware, 0.3)
    firmware.command(np.array([0.7, 0.7, 0, 0, 0, 0]), 0.3)
    assert firmware.duty[0] == 0.0 < firmware.duty[1]
    samples += run(firmware, 0.5)
    mine = [s for s in samples if s.board == 2 and s.t > 0.2]
    assert mine[0].t >= 0.5
    assert mine[0].status == "BOARD 2 READY"
    assert [s.status for s in mine[1:]] == [None] * (len(mine) - 1)
    assert mine[0].t_board == pytest.approx(mine[0].t - 0.5, abs=1e-4)
    assert plant.truth().angle[0] / plant.winches._full[0] == pytest.approx(0.5 * 0.2, rel=0.03)


@pytest.mark.parametrize("apart", [0.0, 1e-3, -1e-3])
def test_boards_that_reset_together_all_forget(apart: float) -> None:
    """At one time, and within one gap between samples in either order."""
    first, second = ({"kind": "board_reset", "board": board, "at_s": at, "for_s": 0.3}
                     for board, at in ((0, 0.2), (2, 0.2 + apart)))  # fmt: skip
    motors = {board: set(make()[0]._boards[board].post.motors) for board in (0, 2)}
    firmware, _ = make(faults=[first, second])
    firmware.command(np.full(6, 0.5), 0.0)
    run(firmware, 0.4)
    assert set(np.flatnonzero(firmware.duty == 0.0).tolist()) == motors[0] | motors[2] and all(motors.values())


def test_a_fault_of_a_board_that_is_not_there_is_refused() -> None:
    """The message names the key, the numbers that there are, and why."""
    with pytest.raises(UsageError) as error:
        make(boards={"layout": "central"}, faults=[{"kind": "board_silent", "board": 1, "at_s": 0.0}])
    assert error.value.where.endswith("faults.0.board")
    assert "central" in error.value.expected


def test_a_central_board_has_everything_in_each_sample() -> None:
    """As on the older robot: nine capacitances and six encoders at once."""
    firmware, _ = make(boards={"layout": "central"})
    samples = run(firmware, 0.2)
    assert all(np.isfinite(s.pF).all() and np.isfinite(s.encoder).all() for s in samples)
    assert firmware.boards == 1


def test_the_battery_is_that_of_the_plant() -> None:
    """Full at rest; under load and with charge gone it shows less."""
    firmware, _ = make(effects={"battery_sag": {"used": 0.5, "fall": 0.4, "per_motor": 0.02}})
    firmware.command(np.ones(6), 0.0)
    last = run(firmware, 0.2)[-1]
    assert last.battery == pytest.approx(7.4 * (1 - 0.4 * 0.25 - 0.12), rel=0.01)
