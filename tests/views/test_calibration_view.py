"""The pictures of a calibration: one for each thing measured, as PNG, also for sensors that are dead."""

from __future__ import annotations

import json
import struct
import tomllib

import numpy as np
import pytest
from matplotlib.figure import Figure

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.stages.calibrate import Source, calibrate
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.views.calibration import draw_calibration
from r2s2r_cli.views.calibration_page import calibration_page
from r2s2r_cli.views.camera_preview import draw_preview
from schemas.results_calibrate import CalibrationReport, RodMass
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


def test_names_are_drawn_as_they_were_typed(data: ArtifactData, robot: Robot) -> None:
    """Sets, files, tendons, parts and rods: between two `$` matplotlib would read a formula, and refuse these."""
    names = (b"cost $\\frac$ b", b"$_{$")
    groups = dict(data.groups)
    for path, key in (("lines", "name"), ("history", "file"), ("tendons", "name"), ("mass_parts", "name")):
        group = groups[path]
        # One of what stands only once in a picture.
        renamed = {**group.datasets, key: np.resize(names if len(group[key]) > 1 else names[1:], len(group[key]))}
        if path == "tendons":  # one that is named in the picture, since it falls
            renamed["monotone"] = np.zeros(len(group[key]), dtype=bool)
        groups[path] = Group(renamed, group.attributes)
    rods = tuple(
        rod.model_copy(update={"name": name.decode()}) for rod, name in zip(robot.rods, (*names, b"a$"), strict=True)
    )
    pictures = dict(draw_calibration(ArtifactData(data.kind, groups), robot.model_copy(update={"rods": rods})))
    assert len(pictures) == 5 and all(png.startswith(PNG) for png in pictures.values())


@pytest.mark.parametrize("name", ["cost $\\frac$ b", "$_{$"])
def test_a_camera_and_its_rods_are_named_as_they_were_typed(name: str) -> None:
    """The same of what `doctor camera --preview` draws."""
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:20, 10:20] = True
    picture = np.zeros((60, 80, 3), dtype=np.uint8)
    assert draw_preview(picture, np.ones((60, 80)), None, masks={name: mask}, title=name).startswith(PNG)


@pytest.mark.parametrize(("rms", "said"), [(np.nan, "all sensors are dead"), (0.0012, "rms 1.20 mm over all points")])
def test_a_set_without_a_live_sensor_has_no_rms(
    data: ArtifactData, robot: Robot, figures: list[Figure], rms: float, said: str
) -> None:
    """It says so instead of `nan mm`."""
    lines = data.groups["lines"]
    changed = Group({**lines.datasets, "rms_set": np.full_like(lines["rms_set"], rms)}, lines.attributes)
    next(draw_calibration(ArtifactData(data.kind, {**data.groups, "lines": changed}), robot))
    assert said in figures[0].get_suptitle() and "nan" not in figures[0].get_suptitle()


def test_a_file_in_which_the_first_sensor_failed_is_in_the_legend(
    data: ArtifactData, robot: Robot, figures: list[Figure]
) -> None:
    """Other sensors are drawn of it; the legend holds it, and is not cut off."""
    history = data.groups["history"]
    state = history["state"].copy()
    state[:, 0] = 1
    name = np.full(len(state), b"a history with a long name, as folders have them.json")
    changed = Group({**history.datasets, "state": state, "file": name}, history.attributes)
    assert "drift" in dict(draw_calibration(ArtifactData(data.kind, {**data.groups, "history": changed}), robot))
    figure = next(one for one in figures if one.legends)
    figure.canvas.draw()
    legend = figure.legends[0]
    assert name[0].decode() in [text.get_text() for text in legend.texts]
    box = legend.get_window_extent()
    assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1


def test_the_page_says_what_pictures_show_and_counts() -> None:
    """One set is a set; a picture that cannot be seen has words instead, and a set's name is no markup."""
    mass = RodMass(rod="<b>green</b>", parts=1, mass_kg=0.1, com_m=0.0, inertia_axial_kg_m2=1e-5,
                   inertia_transverse_kg_m2=1e-3)  # fmt: skip
    report = CalibrationReport.model_construct(
        sets=(), history=None, tendons=None, masses=(mass,), used=None, warnings=()
    )
    page = calibration_page(report, {"sensors-a": b"", "masses": b""}).decode()
    assert "Fitted: 1 weighed rod." in page and "&lt;b&gt;green" in page and "<b>green" not in page
    assert 'alt="sensor lines and their residuals, set a"' in page
    assert 'alt="weighed parts and centre of mass of every rod"' in page
