"""Each effect of the world file visibly does what it says: the experiments of the documentation's pictures."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from r2s2r_cli.rig.camera.camera import RigCamera
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World

CONCEPTS = Path(__file__).parents[2] / "docs" / "concepts"


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("rig_effects_shown", CONCEPTS / "rig_effects_shown.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


SHOWN = _load()
QUICK = ("backlash", "payload", "sensor_gain")


def _run(name: str) -> None:
    one = next(one for one in SHOWN.EXPERIMENTS if one.id == name)
    t, off, _ = SHOWN.trace(one, on=False)
    _, on, _ = SHOWN.trace(one, on=True)
    assert np.isfinite(on).all()
    assert one.true(t, off, on)


@pytest.mark.parametrize("name", QUICK)
def test_a_few_effects_do_what_they_say(name: str) -> None:
    """One on the winch, one on the mass, one on the sensor."""
    _run(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [one.id for one in SHOWN.EXPERIMENTS if one.id not in QUICK])
def test_every_effect_does_what_it_says(name: str) -> None:
    """The sentence below each picture, as an inequality between the two curves."""
    _run(name)


@pytest.mark.slow
@pytest.mark.parametrize("one", SHOWN.CAMERA, ids=lambda one: one.id)
def test_effects_of_the_camera_show_in_its_pictures(one: object) -> None:
    """The picture changes, and the robot's motion does not."""
    pictures, caps = [], []
    for table in ({}, {one.id: dict(one.table)}):  # type: ignore[attr-defined]
        world = World.model_validate({"effects": table})
        plant = Plant(SHOWN.ROBOT, world)
        caps.append(plant.truth().p_WE)
        pictures.append(RigCamera(SHOWN.ROBOT, world.seen(), seed=1).capture(0, 0.0, caps[-1]))
    np.testing.assert_array_equal(caps[0], caps[1])
    changed = pictures[0].depth != pictures[1].depth
    assert changed.mean() > 0.1


def test_every_effect_has_its_experiment_and_its_picture() -> None:
    """A new effect of the world file needs a picture, a section and a sentence."""
    page = (CONCEPTS / "rig-effects.md").read_text(encoding="utf-8")
    shown = {one.id for one in (*SHOWN.EXPERIMENTS, *SHOWN.CAMERA)}
    assert shown == set(Effects.model_fields)
    assert re.findall(r"^## `(\w+)`$", page, flags=re.MULTILINE) == list(Effects.model_fields)
    for name in Effects.model_fields:
        assert (CONCEPTS / "rig-effects" / f"{name}.png").stat().st_size > 1000
