"""The pictures of a calibration: one for each thing measured, as PNG, also for sensors that are dead."""

from __future__ import annotations

import json
import struct
import tomllib

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.calibrate import Source, calibrate
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.views.calibration import draw_calibration
from r2s2r_cli.views.camera_preview import draw_preview
from schemas.robot import Robot

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def robot() -> Robot:
    """The 3-bar robot."""
    return Robot.model_validate(tomllib.loads(robot_toml("threebar")))


@pytest.fixture(scope="module")
def data(robot: Robot) -> ArtifactData:
    """Two sets with a dead and a falling sensor, a history with a failed fit and a swap, one tendon, one rod."""
    rows = ["set,sensor_id,length_mm,capacitance_pF"]
    for name in ("may/3", "may:3"):
        for sensor, slope in enumerate([0.03, 0.0, -0.03, *[0.03] * 6]):
            rows += [
                f"{name},{sensor},{x},{20 + slope * x + (x * 7 % 3) / 50 * (slope != 0)}" for x in range(100, 200, 20)
            ]
    sets = [
        {"date": f"2025-01-0{i}", "m_pF_per_mm": [0.03 * (i != 2), *[0.03] * 8], "b_pF": [16 + 2 * (i == 3)] * 9}
        for i in (1, 2, 3, 4)
    ]
    x = np.linspace(0, 0.1, 6)
    pull = "\n".join(["displacement_m,force_N", *(f"{a},{80 * a}" for a in x)])
    part = '[[part]]\nrod = "green"\nname = "all"\nmass_kg = 0.13\noffset_m = 0.01\nshape = "sphere"\nradius_m = 0.02\n'
    found, _ = calibrate(
        robot=robot,
        points=Source("points.csv", "\n".join(rows).encode()),
        history=Source("history.json", json.dumps(sets).encode()),
        tendons=[Source("pull.csv", pull.encode())],
        masses=Source("masses.toml", part.encode()),
    )
    return found


def test_everything_measured_is_drawn(data: ArtifactData, robot: Robot) -> None:
    """One PNG per set, with different file names, and one each for drift, tendons and masses."""
    pictures = dict(draw_calibration(data, robot))
    assert list(pictures) == ["sensors-may_3-1", "sensors-may_3-2", "drift", "tendons", "masses"]
    for png in pictures.values():
        assert png.startswith(PNG)
        width, height = struct.unpack(">II", png[16:24])
        assert width >= 800 and height >= 250


def test_the_same_calibration_gives_the_same_pictures(data: ArtifactData, robot: Robot) -> None:
    """Bytes do not depend on the moment of drawing."""
    only = ArtifactData(data.kind, {"tendon_points": data.groups["tendon_points"], "tendons": data.groups["tendons"]})
    assert list(draw_calibration(only, robot)) == list(draw_calibration(only, robot))


def test_other_measurements_give_another_picture(data: ArtifactData, robot: Robot) -> None:
    """The picture shows the numbers: with another force it differs."""
    points, tendons = data.groups["tendon_points"], data.groups["tendons"]
    stronger = Group({**tendons.datasets, "k1": tendons["k1"] * 1.5}, tendons.attributes)
    one, other = (
        dict(draw_calibration(ArtifactData(data.kind, {"tendon_points": points, "tendons": group}), robot))["tendons"]
        for group in (tendons, stronger)
    )
    assert one != other


@pytest.mark.parametrize("name", [b"cost $\\frac$ b", b"$_{$"])
def test_names_are_drawn_as_they_were_typed(data: ArtifactData, robot: Robot, name: bytes) -> None:
    """Sets, files, tendons, parts and rods: between two `$` matplotlib would read a formula, and refuse these."""
    groups = dict(data.groups)
    for path, key in (("lines", "name"), ("history", "file"), ("tendons", "name"), ("mass_parts", "name")):
        group = groups[path]
        renamed = {**group.datasets, key: np.full(len(group[key]), name)}
        if path == "tendons":  # one that is named in the picture, since it falls
            renamed["monotone"] = np.zeros(len(group[key]), dtype=bool)
        groups[path] = Group(renamed, group.attributes)
    rods = tuple(rod.model_copy(update={"name": name.decode()}) for rod in robot.rods)
    pictures = dict(draw_calibration(ArtifactData(data.kind, groups), robot.model_copy(update={"rods": rods})))
    assert len(pictures) == 5 and all(png.startswith(PNG) for png in pictures.values())


@pytest.mark.parametrize("name", ["cost $\\frac$ b", "$_{$"])
def test_a_camera_and_its_rods_are_named_as_they_were_typed(name: str) -> None:
    """The same of what `doctor camera --preview` draws."""
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:20, 10:20] = True
    picture = np.zeros((60, 80, 3), dtype=np.uint8)
    assert draw_preview(picture, np.ones((60, 80)), None, masks={name: mask}, title=name).startswith(PNG)
