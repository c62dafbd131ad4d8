"""`r2s2r doctor camera` on the rig's camera, over a real socket, and on what can go wrong with it."""

from __future__ import annotations

import json
import shlex
import threading
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from r2s2r_cli.app import app
from r2s2r_cli.rig.camera import pinhole
from r2s2r_cli.rig.camera.camera import RigCamera
from r2s2r_cli.rig.camera.service import CameraService
from r2s2r_cli.rig.camera.settings import CameraSettings, Clock
from r2s2r_cli.stages.doctor.colors import hsv_of, in_range
from schemas.robot import Robot
from tests.support.rig_robots import known

THREE = known()
SETTINGS = CameraSettings(position_m=(0.1, -0.3, 1.2), clock=Clock(rate_hz=30.0, lost_share=0.0))


@pytest.fixture(scope="module")
def spec() -> Iterator[str]:
    """The rig's camera over a robot at rest."""
    stop = threading.Event()
    with CameraService(THREE, SETTINGS, seed=2) as service:
        begin = time.monotonic()

        def loop() -> None:
            while not stop.wait(0.005):
                service.observe(time.monotonic() - begin, np.array(THREE.rest_caps_m))

        thread = threading.Thread(target=loop)
        thread.start()
        yield "rig://{}:{}".format(*service.address)
        stop.set()
        thread.join()


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh project, and the working directory in it."""
    assert CliRunner().invoke(app, ["init", str(tmp_path / "p")]).exit_code == 0
    monkeypatch.chdir(tmp_path / "p")
    return tmp_path / "p"


def run(*arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout, stderr of `r2s2r doctor camera`."""
    result = CliRunner().invoke(app, ["doctor", "camera", *arguments])
    return result.exit_code, result.stdout, result.stderr


def pixel(cap: int) -> str:
    """Where a cap is in the picture, as `--click` wants it."""
    p_C = pinhole.into(pinhole.pose(SETTINGS), np.array(THREE.rest_caps_m[cap]))
    lens = pinhole.true(SETTINGS)
    return f"{int(lens.fx * p_C[0] / p_C[2] + lens.cx)},{int(lens.fy * p_C[1] / p_C[2] + lens.cy)}"


def test_what_the_camera_states_and_sees(spec: str, project: Path) -> None:
    """Geometry as stated, the ground at its distance and tilt, two caps of each rod, and a picture of it all."""
    code, out, _ = run("--camera", spec, "--frames", "5", "--json", "--preview", "see.png")
    assert code == 0
    said = json.loads(out)
    assert (said["width"], said["height"], said["fx"], said["cx"]) == (640, 480, 607.7, 320.0)
    assert said["depth_scale_m"] == 0.00025 and said["frames"] == 5
    assert said["rate_hz"] == pytest.approx(30.0, rel=0.05)
    assert said["ground"]["distance_m"] == pytest.approx(1.2, abs=0.002)
    assert said["ground"]["tilt_rad"] == pytest.approx(np.arctan2(np.hypot(0.1, 0.3), 1.2), abs=0.002)
    assert {rod["rod"]: rod["patches"] for rod in said["rods"]} == {"red": 2, "green": 2, "blue": 2}
    assert (project / "see.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_clicks_and_boxes_become_ranges_in_robot_toml(spec: str, project: Path) -> None:
    """Ranges measured from marks are written, comments stay, they find their caps; the page takes more marks."""
    before = (project / "robot.toml").read_text()
    u, v = (int(x) for x in pixel(2).split(","))
    marks = ["--click", f"red:{pixel(1)}", "--box", f"green:{u - 12},{v - 12},{u + 12},{v + 12}"]
    code, out, err = run("--camera", spec, "--frames", "5", *marks, "--save", "--preview", "see.html")
    assert code == 0, err
    page = (project / "see.html").read_text()
    assert f'"command": "r2s2r doctor camera --camera {spec}"' in page
    assert all(f'value="{rod}"' in page for rod in ("red", "green", "blue"))
    assert "colour ranges written" in out
    text = (project / "robot.toml").read_text()
    robot = Robot.model_validate(tomllib.loads(text))
    old = {color.rod: color for color in Robot.model_validate(tomllib.loads(before)).colors}
    new = {color.rod: color for color in robot.colors}
    assert new["blue"] == old["blue"] and new["red"] != old["red"] and new["green"] != old["green"]
    assert len(text.splitlines()) == len(before.splitlines())

    color = RigCamera(THREE, SETTINGS, seed=2).capture(0, 0.0, np.array(THREE.rest_caps_m)).color
    for rod, cap in (("red", 1), ("green", 2)):
        column, row = (int(x) for x in pixel(cap).split(","))
        assert in_range(hsv_of(color), new[rod])[row, column]


def pasted(stderr: str) -> list[str]:
    """The last hint as the words behind `r2s2r doctor camera`."""
    words = shlex.split(stderr.splitlines()[-1], comments=True)
    assert words[:4] == ["hint:", "r2s2r", "doctor", "camera"]
    return words[4:]


def test_without_save_nothing_is_written(spec: str, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Marks alone show the measured ranges; the hint, pasted, keeps them."""
    before = (project / "robot.toml").read_bytes()
    typed = ["--camera", spec, "--frames", "5", "--click", f"red:{pixel(1)}"]
    monkeypatch.setattr("sys.argv", ["r2s2r", "doctor", "camera", *typed])
    code, out, err = run(*typed)
    assert code == 0 and "measured" in out
    assert (project / "robot.toml").read_bytes() == before
    assert pasted(err) == [*typed, "--save"]
    assert run(*pasted(err))[0] == 0
    assert (project / "robot.toml").read_bytes() != before


def test_marks_beside_the_caps_are_looked_at_in_a_preview(spec: str, project: Path) -> None:
    """Without the marks, which would be refused again, through the same camera; so is a camera without any mark."""
    code, _, err = run("--camera", spec, "--frames", "2", "--project", ".", "--click", "red:5,5")
    assert code == 4 and pasted(err) == ["--camera", spec, "--project", ".", "--preview", "see.html"]
    code, _, err = run(*pasted(err), "--frames", "2")
    assert code == 0 and (project / "see.html").is_file()
    assert pasted(run("--camera", spec, "--frames", "2")[2])[-2:] == ["--preview", "see.html"]


def test_without_a_project_nothing_can_be_saved(spec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hint does not ask for it."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run("--camera", spec, "--frames", "2", "--click", f"red:{pixel(1)}")
    assert code == 0 and "measured" in out and "--save" not in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["--click", "red:1"], 2), (["--click", "red:1,2,3"], 2), (["--box", "red:9,9,3,3"], 2), (["--save"], 2),
        (["--camera", "webcam"], 2), (["--click", "pink:320,240", "--camera", "SPEC"], 2),
        (["--click", "red:5,5", "--camera", "SPEC"], 4), (["--camera", "rig://127.0.0.1:1"], 5),
        (["--camera", "replay:nowhere"], 5),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_mistakes_are_told(arguments: list[str], code: int, spec: str, project: Path) -> None:
    """Each mistake has its exit code and a hint, and changes nothing."""
    before = (project / "robot.toml").read_bytes()
    found, _, err = run("--frames", "5", *(spec if text == "SPEC" else text for text in arguments))
    assert found == code, err
    assert err.splitlines()[-1].startswith("hint: ")
    assert (project / "robot.toml").read_bytes() == before


def test_it_works_without_a_project(spec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside of a project geometry and ground are shown; there is no rod to look for."""
    monkeypatch.chdir(tmp_path)
    code, out, _ = run("--camera", spec, "--frames", "2", "--json")
    assert code == 0 and json.loads(out)["rods"] == []


def test_a_recording_is_played_back(project: Path) -> None:
    """The pictures of 10-record.h5 stand for a camera, by its run or without; a run without pictures is refused."""
    picture = RigCamera(THREE, SETTINGS.ideal()).capture(0, 0.0, np.array(THREE.rest_caps_m))
    folder = project / "rgbd"
    for name, image in (("color", picture.color[..., ::-1]), ("depth", picture.depth)):
        (folder / name).mkdir(parents=True)
        for i in range(3):
            assert cv2.imwrite(str(folder / name / f"{i:04d}.png"), image)
    (folder / "data").mkdir()
    for i in range(3):
        frame = {"header": {"secs": 10 + 0.1 * i, "seq": i}, "info": {}, "sensors": {}, "motors": {}}
        (folder / "data" / f"{i:04d}.json").write_text(json.dumps(frame))
    K = [[607.7, 0, 319.5], [0, 607.7, 239.5], [0, 0, 1]]
    config = {"cam_intr": K, "depth_scale": 4000, "im_w": 640, "im_h": 480}
    (folder / "config.json").write_text(json.dumps(config))
    sidecar = 'robot = "threebar"\nsource = "the rig"\nnature = "simulated"\n'
    (project / "rgbd.toml").write_text(sidecar)
    imported = CliRunner().invoke(app, ["import", str(folder), "--no-draw"])
    assert imported.exit_code == 0, imported.stderr
    record = "iterations/001/10-record.h5"
    for spec in (f"replay:{record}", f"replay:{record}:rgbd"):
        code, out, err = run("--camera", spec, "--frames", "3", "--json")
        assert code == 0, err
        said = json.loads(out)
        assert said["fx"] == 607.7 and said["cx"] == 320.0
        assert said["ground"]["distance_m"] == pytest.approx(1.2, abs=0.002)
    assert run("--camera", f"replay:{record}:other")[0] == 5
