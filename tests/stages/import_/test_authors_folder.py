"""The authors' folder layout, made in a temporary folder: units, missing parts, swapped images, broken frames."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import Blobs
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_ import ImportedRun, import_source
from tests.support.import_samples import CONFIG, frame_json, sample_robot, write_authors_folder, write_image
from tests.support.run_layout import assert_run_layout

ROBOT = sample_robot()
START = 1676990000.0


def frames(n: int = 6, **changes: Any) -> list[dict[str, Any]]:
    """Good frames at 10 Hz."""
    return [frame_json(START + 0.1 * i, **changes) for i in range(n)]


def load(root: Path, **more: Any) -> ImportedRun:
    """Import a folder."""
    return import_source(root, robot=ROBOT, **more)


def refusal(root: Path, **more: Any) -> InputError:
    """The error of a folder that must be refused."""
    with pytest.raises(InputError) as caught:
        load(root, **more)
    assert caught.value.hint
    return caught.value


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Six good frames."""
    return write_authors_folder(tmp_path / "walk", frames())


def test_units_become_si(folder: Path) -> None:
    """pF, mm, g, deg/s and host speeds of the recorder are F, m, m/s^2, rad/s and fractions in the recording."""
    groups = load(folder).groups
    assert groups["sensors"]["capacitance"][0, 2] == pytest.approx(17.5e-12)
    assert groups["sensors"]["length"][0, 2] == pytest.approx(0.122)
    assert groups["sensors"]["cable"].tolist() == list(range(9))
    assert groups["imu"]["a_B"][0] == pytest.approx([0, 0, 9.80665])
    assert groups["imu"]["w_WB"][0] == pytest.approx([0, math.pi / 2, 0])
    assert groups["commands"]["control"][0] == pytest.approx(np.full(6, -0.5))
    assert groups["motors"]["encoder_length"][0] == pytest.approx(np.full(6, 0.011))
    assert groups["mocap"]["p_ME"][0, 4] == pytest.approx([0.4, 0, 0.0175])
    assert np.isnan(groups["mocap"]["p_ME"][0, 5]).all()
    attributes = groups[""].attributes
    assert attributes["pid_min_length"] == pytest.approx(0.095)
    assert attributes["motor_speed"] == pytest.approx(0.8), "the sidecar's word wins over 80 / 99"
    assert attributes["pid_p"] == 6
    assert attributes["start_unix"] == START
    assert groups["commands"]["t"] == pytest.approx(0.1 * np.arange(6), abs=1e-6)


def test_groups_and_datasets_are_those_of_the_layout(folder: Path) -> None:
    """Every stream of the folder is in the schema with its type and shape, the camera's pose included."""
    (folder / "config.json").write_text(json.dumps(CONFIG | {"cam_extr": np.eye(4).tolist()}))
    groups = load(folder).groups
    assert_run_layout(groups)
    assert set(groups) == {"", "commands", "motors", "sensors", "imu", "mocap", "camera", "intervals", "segments"}


def test_camera_frames_are_the_bytes_on_disk(folder: Path) -> None:
    """Images are handed on unread and unchanged, can be gone through twice, and are paired by number."""
    camera = load(folder).groups["camera"]
    color, depth = camera.datasets["color"], camera.datasets["depth"]
    assert isinstance(color, Blobs) and isinstance(depth, Blobs)
    assert list(color.items) == list(color.items) == [p.read_bytes() for p in sorted((folder / "color").iterdir())]
    assert (color.count, depth.count) == (6, 6)
    assert camera["pair"].tolist() == list(range(6))
    assert camera.attributes["depth_scale"] == pytest.approx(1 / 4000)
    # OpenCV's first pixel has its centre at 0, ours at 0.5.
    assert (camera.attributes["fx"], camera.attributes["cx"], camera.attributes["cy"]) == (600.0, 4.0, 3.0)


def test_missing_parts_are_counted_and_pairs_say_none(folder: Path) -> None:
    """A frame without depth has no partner, one without JSON has no time and is left out; all are counted."""
    (folder / "depth" / "0002.png").unlink()
    (folder / "data" / "0004.json").unlink()
    run = load(folder)
    assert run.report.missing["depth"] == 1
    assert run.report.missing["data"] == 1
    assert run.report.rows == 5
    camera = run.groups["camera"]
    assert camera["source_frame"].tolist() == [0, 1, 2, 3, 5]
    assert camera["pair"].tolist() == [0, 1, -1, 2, 3]
    assert len(camera["t_depth"]) == 4


def test_a_folder_without_depth_or_without_images_is_a_recording_too(folder: Path) -> None:
    """What is absent is left out, not stored empty; no depth scale is asked for; missing frames are counted."""
    shutil.rmtree(folder / "depth")
    (folder / "config.json").unlink()
    run = load(folder)
    assert "depth" not in run.groups["camera"]
    assert run.groups["camera"]["pair"].tolist() == [-1] * 6
    assert run.report.missing["depth"] == 6
    shutil.rmtree(folder / "color")
    assert "camera" not in load(folder).groups
    # Images without any JSON of their number have no time.
    write_image(folder / "color" / "0099.png", depth=False)
    run = load(folder)
    assert "camera" not in run.groups
    assert run.report.missing["data"] == 1


def test_intervals_come_from_the_motor_targets(tmp_path: Path) -> None:
    """Targets of the motors cut the run; the last interval ends where every cable is at its target."""
    made = frames(8)
    for frame in made[4:]:
        for motor in frame["motors"].values():
            motor |= {"target": 0.0, "position": 0.04, "done": True}
    report = load(write_authors_folder(tmp_path / "walk", made)).report
    assert (report.intervals, report.intervals_complete) == (2, 2)


def test_close_frames_are_reported_and_kept_in_the_raw_streams(tmp_path: Path) -> None:
    """A frame 5 ms after another is a duplicate in the report and stays among the raw samples."""
    made = frames(6)
    made[3]["header"]["secs"] = made[2]["header"]["secs"] + 0.005
    run = load(write_authors_folder(tmp_path / "walk", made))
    assert (run.report.rows, run.report.kept, run.report.dropped.duplicate) == (6, 5, 1)
    assert run.report.streams["camera/color"] == run.report.streams["commands"] == 6


@pytest.mark.parametrize("scale", [0.001, 0.00025])
def test_the_depth_scale_is_asked_for_and_never_guessed(folder: Path, scale: float) -> None:
    """Without config.json the option is needed; with it the two must agree."""
    (folder / "config.json").unlink()
    assert "--depth-scale" in refusal(folder).hint
    assert load(folder, depth_scale=scale).groups["camera"].attributes["depth_scale"] == scale


def test_depth_scales_that_disagree_or_are_inverted_are_refused(folder: Path) -> None:
    """1/1000 against the file's 1/4000, and 4000 instead of 1/4000, are errors."""
    assert "disagree" in refusal(folder, depth_scale=0.001).what
    assert load(folder, depth_scale=0.00025).groups["camera"].attributes["depth_scale"] == 0.00025
    (folder / "config.json").unlink()
    assert refusal(folder, depth_scale=4000).hint == "--depth-scale 0.00025"


def test_swapped_colour_and_depth_are_named(folder: Path) -> None:
    """Depth images in the colour folder are recognised by their headers."""
    (folder / "color").rename(folder / "tmp")
    (folder / "depth").rename(folder / "color")
    (folder / "tmp").rename(folder / "depth")
    assert "swapped" in refusal(folder).what


def test_wrong_images_are_refused_by_name(folder: Path) -> None:
    """Cut-off, foreign, grey and differently sized images each name the file."""
    image = folder / "color" / "0003.png"
    whole = image.read_bytes()
    for data, word in (
        (whole[:-9], "cut off"),
        (b"GIF89a" + whole, "neither"),
        (b"", "neither"),
        (whole[:20], "cut off"),
    ):
        image.write_bytes(data)
        error = refusal(folder)
        assert word in error.what and "0003.png" in error.where
    write_image(image, depth=False, size=(9, 6))
    assert "size" in refusal(folder).what
    shutil.copy(folder / "depth" / "0003.png", image)
    assert "swapped" in refusal(folder).what
    image.write_bytes(whole)
    write_image(folder / "depth" / "0001.png", depth=False)
    assert "swapped" in refusal(folder).what


def test_jpeg_colour_is_accepted(folder: Path) -> None:
    """Colour frames may be JPEG; their size is read from the frame header."""
    for path in sorted((folder / "color").iterdir()):
        write_image(path.with_suffix(".jpg"), depth=False)
        path.unlink()
    assert load(folder).report.streams["camera/color"] == 6


def test_two_files_of_one_number_are_refused(folder: Path) -> None:
    """0001.png and 1.png are the same frame twice."""
    shutil.copy(folder / "color" / "0001.png", folder / "color" / "1.png")
    assert "stands twice" in refusal(folder).what


def test_a_broken_frame_is_named_with_its_position(folder: Path) -> None:
    """A JSON cut off in the middle gives file, line and column."""
    path = folder / "data" / "0002.json"
    path.write_text(path.read_text()[:100])
    assert refusal(folder).where.startswith(f"{path}:1:")


def test_another_robot_is_refused(tmp_path: Path) -> None:
    """A seventh motor or a tenth sensor belongs to another robot, and so does another name in the sidecar."""
    motors = frame_json()["motors"]
    root = write_authors_folder(tmp_path / "a", frames(motors=motors | {"6": motors["0"]}))
    assert "number of motors" in refusal(root).what
    root = write_authors_folder(tmp_path / "b", frames(sensors={"9": {"capacitance": 1.0, "length": 1.0}}))
    assert "number of sensors" in refusal(root).what
    root = write_authors_folder(tmp_path / "c", frames())
    (tmp_path / "c.toml").write_text('robot = "other"\nsource = "x"\n')
    assert "another robot" in refusal(root).what


def test_a_speed_above_its_maximum_is_refused(tmp_path: Path) -> None:
    """Commands have no scale where speed and info.max_speed contradict each other."""
    info = frame_json()["info"] | {"max_speed": 30}
    assert "maximum speed" in refusal(write_authors_folder(tmp_path / "a", frames(info=info))).what


def test_odd_but_honest_frames_are_reported(tmp_path: Path) -> None:
    """Sensor chips that are not ready, changes of info, foreign markers and old imu forms are said, not hidden."""
    made = frames(5)
    made[1]["sensors"]["4"]["capacitance"] = 0.20
    made[2]["info"]["tol"] = 0.2
    made[2]["mocap"]["17"] = {"x": 0, "y": 0, "z": 0}
    made[3]["imu"] = {"0": {"yaw": 1.0}}
    made[3]["motors"].pop("5")
    report = load(write_authors_folder(tmp_path / "walk", made)).report
    text = " | ".join(report.warnings)
    for word in ("0.20 pF", "tol", "[17]", "accelerometer"):
        assert word in text
    assert report.missing["motor"] == 1


def test_two_ranges_leave_the_range_open(tmp_path: Path) -> None:
    """The newer host has one range for cables 0, 2, 4 and one for 1, 3, 5: no single number is stored."""
    info = frame_json()["info"] | {"RANGE": 0, "RANGE024": 100, "RANGE135": 80}
    root = write_authors_folder(tmp_path / "walk", frames(info=info))
    root.with_name("walk.toml").write_text('robot = "sample"\nsource = "x"\n')
    run = load(root)
    assert "pid_range" not in run.groups[""].attributes
    assert run.groups[""].attributes["motor_speed"] == pytest.approx(80 / 99)
    info["RANGE135"] = 100
    root = write_authors_folder(tmp_path / "walk2", frames(info=info))
    root.with_name("walk2.toml").write_text('robot = "sample"\nsource = "x"\n')
    assert load(root).groups[""].attributes["pid_range"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    "change",
    [
        {"cam_intr": [[600, 0, 3.5], [0, 601, 2.5]]},
        {"cam_intr": [[0, 0, 3.5], [0, 601, 2.5], [0, 0, 1]]},
        {"cam_intr": [[600, 0, None], [0, 601, 2.5], [0, 0, 1]]},
        {"cam_intr": "640x480"},
        {"im_w": 640},
        {"depth_scale": 0},
        {"depth_scale": -4000},
        {"depth_scale": 0.001},
        {"depth_scale": "4000"},
        {"cam_extr": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
        {"cam_extr": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
    ],
)
def test_a_camera_configuration_that_cannot_be_is_refused(folder: Path, change: dict[str, Any]) -> None:
    """Broken matrices, sizes and scales are named with the file."""
    (folder / "config.json").write_text(json.dumps(CONFIG | change))
    assert "config.json" in refusal(folder).where


def test_real_camera_files_are_read(folder: Path, real_dir: Path) -> None:
    """The authors' own intrinsics and camera pose pass the checks (with the image size of the test)."""
    intrinsics = json.loads((real_dir / "tribar_camera" / "d435_intrinsics_640x480.json").read_text())
    pose = json.loads((real_dir / "tribar_camera" / "cam_extr.json").read_text())
    (folder / "config.json").write_text(json.dumps(intrinsics | pose | {"im_w": 8, "im_h": 6}))
    camera = load(folder).groups["camera"]
    assert camera.attributes["fx"] == pytest.approx(607.6858520507812)
    assert camera["X_WC"][2, 3] == pytest.approx(2.4020448850865614)
