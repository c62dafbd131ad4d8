"""The hand that puts the rig's robot back between runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.rig.firmware import Firmware
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from tests.support.rig_robots import known

ROBOT = known()
GAIT = np.array([0.8, 0.0, 0.5, 0.0, -0.1, 0.0])
CABLES = np.array([cable.caps for cable in ROBOT.cables])


def made(**tables: Any) -> tuple[Firmware, Plant]:
    """Boards on a plant that has settled quickly."""
    world = World.model_validate(tables)
    plant = Plant(ROBOT, world)
    return Firmware(ROBOT, world, plant), plant


def run(firmware: Firmware, seconds: float, tick: float = 0.02) -> None:
    """Time goes on."""
    start = firmware.t
    for k in range(1, round(seconds / tick) + 1):
        firmware.tick(start + k * tick)


def test_a_hand_puts_a_robot_that_has_moved_back_to_its_start() -> None:
    """After a stop it lies at its start, whatever side it has rolled to: the shape its cables have, the side of the
    start, at rest, turned; once, and only where asked."""
    place = [0.3, -0.2]
    firmware, plant = made(start={"settle_s": 0.2, "put_back": True, "position_m": place}, seed=4)
    start = plant.truth().p_WE
    firmware.stop()
    np.testing.assert_array_equal(plant.truth().p_WE, start)
    firmware.command(np.array([1.0, 0.0, 1.0, 1.0, 0.0, 0.6]), firmware.t)
    run(firmware, 1.5)
    before = plant.truth()
    firmware.stop()
    after = plant.truth()
    np.testing.assert_allclose(after.p_WE.mean(axis=0)[:2], start.mean(axis=0)[:2], atol=1e-9)
    assert after.p_WE[:, 2].min() == pytest.approx(start[:, 2].min(), abs=1e-9)
    np.testing.assert_allclose(after.length, before.length, atol=1e-9)
    np.testing.assert_array_equal(after.rest, before.rest)
    assert (after.v_WR == 0).all()
    # Within the change of its shape the heights of its caps are those of the start: the same side is down.
    change = np.abs(after.length - np.linalg.norm(start[CABLES[:, 0]] - start[CABLES[:, 1]], axis=1)).max()
    assert change > 0.005
    assert np.abs(after.p_WE[:, 2] - start[:, 2]).max() < 2 * change
    axis = [caps[1] - caps[0] for caps in (start, after.p_WE)]
    assert abs(np.arctan2(axis[1][1], axis[1][0]) - np.arctan2(axis[0][1], axis[0][0])) > 0.05
    firmware.stop()
    np.testing.assert_array_equal(plant.truth().p_WE, after.p_WE)

    other, its = made(start={"settle_s": 0.2, "position_m": place}, seed=4)
    other.command(GAIT, other.t)
    run(other, 0.5)
    there = its.truth().p_WE
    other.stop()
    np.testing.assert_array_equal(its.truth().p_WE, there)
