"""The effects of the rig: which there are, apart from the catalogue of `diagnose`, and nothing at size 0."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import r2s2r_cli.effects
import r2s2r_cli.rig
from r2s2r_cli.rig.effects.base import Law
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.plant import Plant
from tests.support.rig_laws import DT, world
from tests.support.rig_robots import known

STARRED = {
    "motor_dead_zone", "command_latency", "motor_lag", "motor_speed_mismatch", "battery_sag", "load_droop",
    "spool_buildup", "backlash", "tendon_stiffness", "tendon_relaxation", "tendon_set", "com_offset", "payload",
    "friction_field", "rolling_resistance", "soft_ground", "cap_friction", "cap_radius", "ground_slope", "tether_drag",
    "sensor_bias", "sensor_gain", "camera_pose", "camera_scale", "camera_delay",
}  # fmt: skip
"""The effects of the first release."""

OTHERS = {
    "tendon_hysteresis", "capstan_friction", "attachment_offset", "friction_anisotropy", "stribeck", "viscous_contact",
    "obstacle", "air_drag", "sensor_saturation", "dropout",
}  # fmt: skip
"""The rest of the catalogue."""


def test_every_effect_of_the_first_release_is_there() -> None:
    """The 25 starred ids of the design, the other ten, and no id that the design does not have."""
    assert set(Effects.model_fields) == STARRED | OTHERS


def test_nothing_is_shared_with_the_catalogue() -> None:
    """No file of the rig imports the catalogue or the engine, and no file of the catalogue imports the rig."""
    for package, forbidden in (
        (r2s2r_cli.rig, ("r2s2r_cli.effects", "r2s2r_cli.engine", "torch")),
        (r2s2r_cli.effects, ("r2s2r_cli.rig", "mujoco")),
    ):
        files = list(Path(str(package.__path__[0])).rglob("*.py"))
        assert files
        for path in files:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                assert not [name for name in names if name.startswith(forbidden)], path


def test_no_function_is_a_copy_of_the_catalogues() -> None:
    """No function of the rig's effects has the same body as one of the catalogue."""

    def bodies(package: object) -> set[str]:
        found = set()
        for path in Path(str(package.__path__[0])).rglob("*.py"):  # type: ignore[attr-defined]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef):
                    code = [part for part in node.body if not isinstance(getattr(part, "value", None), ast.Constant)]
                    text = "\n".join(ast.dump(part) for part in code)
                    if len(text) > 200:
                        found.add(text)
        return found

    import r2s2r_cli.rig.effects as rig_effects

    assert not bodies(rig_effects) & bodies(r2s2r_cli.effects)


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("motor_dead_zone", {"start": 0.0, "keep": 0.0}),
        ("command_latency", {"delay_s": 0.0}),
        ("motor_lag", {"start_s": 0.0}),
        ("motor_speed_mismatch", {"factors": []}),
        ("battery_sag", {"fall": 0.0, "per_motor": 0.0}),
        ("spool_buildup", {"layer_m": 0.0}),
        ("backlash", {"play_m": 0.0}),
        ("tendon_stiffness", {"factors": []}),
        ("tendon_set", {"lengths_m": []}),
        ("tendon_relaxation", {"fast_share": 0.0, "slow_share": 0.0}),
        ("tendon_hysteresis", {"force_n": 0.0}),
        ("capstan_friction", {"wrap": 0.0}),
        ("cap_radius", {"by_m": []}),
        ("ground_slope", {}),
        ("viscous_contact", {"drag_n_s_per_m": 0.0}),
        ("tether_drag", {"weight_n": 0.0, "largest_n": 0.0}),
        ("sensor_bias", {"lengths_m": []}),
    ],
)
def test_a_law_of_size_0_changes_nothing(name: str, table: dict[str, object]) -> None:
    """The motion under a law of size 0 is the motion without it, but for rounding of numbers that were added to 0."""
    duty = np.array([0.8, 0.0, -0.4, 0.5, 0.0, 0.0])
    caps = []
    for effects in ({}, {name: table}):
        plant = Plant(known(), world(**effects))
        plant.advance(0.2, duty)
        plant.advance(0.1, -duty)
        caps.append(np.append(plant.truth().p_WE, plant.sensed()))
    np.testing.assert_allclose(caps[1], caps[0], atol=1e-9)


def test_effects_of_the_camera_reach_its_settings() -> None:
    """Each changes what it says, keeps the rest, and leaves the table as it was."""
    world_ = world(
        camera_pose={"turn_rad": [0, 0, 0.1], "at_s": 3.0}, camera_scale={"depth_error": 0.03},
        camera_delay={"delay_s": 0.07}, dropout={"frames": 0.5},
    )  # fmt: skip
    seen = world_.seen()
    assert (seen.turn_rad, seen.knocked_at_s, seen.depth_error) == ((0.0, 0.0, 0.1), 3.0, 0.03)
    assert (seen.clock.stamp_delay_s, seen.clock.lost_share) == (0.07, 0.5)
    assert seen.clock.rate_hz == world_.camera.clock.rate_hz
    assert world_.camera.clock.stamp_delay_s == 0.0


def test_a_law_without_hooks_is_no_law() -> None:
    """The base class passes everything on."""
    law, x = Law(), np.arange(6.0)
    for out in (
        law.command(0, x),
        law.turn(DT, x, x),
        law.radius(x, x),
        law.rest(DT, x, x),
        law.friction(x),
        law.sense(0, x),
    ):
        assert out is x
    assert law.volts(DT, 0.7, x) == 0.7
