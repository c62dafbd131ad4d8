"""Films: folders and recordings played back frame by frame, and what cannot be."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.devices.camera import CameraEnded, CameraError, Frame, Intrinsics
from r2s2r_cli.errors import UsageError
from r2s2r_cli.hardware.camera.choose import choose_camera
from r2s2r_cli.hardware.camera.films import folder_film, recorded_film
from r2s2r_cli.hardware.camera.replay import Film, ReplayCamera

LENS = Intrinsics(8, 6, 10.0, 11.0, 4.5, 3.5)


def png(image: np.ndarray) -> bytes:
    """A picture as PNG; colour is given as RGB."""
    done, data = cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)
    assert done
    return bytes(data.tobytes())


def color(i: int) -> np.ndarray:
    """Colour picture i, red in its number."""
    return np.full((6, 8, 3), (10 * i, 5, 200), dtype=np.uint8)


def depth(i: int) -> np.ndarray:
    """Depth picture i."""
    return np.full((6, 8), 1000 + i, dtype=np.uint16)


def film(count: int = 3, rate: float = 30.0) -> Film:
    """Pictures at a rate, from stamp 50 on."""

    def pictures() -> Iterator[tuple[bytes, bytes | None, float]]:
        for i in range(count):
            yield png(color(i)), png(depth(i)), 50 + i / rate

    return Film("test", LENS, 0.001, rate, pictures)


def played(camera: ReplayCamera) -> list[Frame]:
    """All frames."""
    found = []
    with camera:
        while True:
            try:
                frame = camera.read(1.0)
            except CameraEnded:
                return found
            assert frame is not None
            found.append(frame)


def folder(root: Path, count: int = 3, *, config: dict[str, Any] | None = None, name: str = "config.json") -> Path:
    """The authors' folder, stamps 0.1 s apart from 1000 on."""
    for part in ("color", "depth", "data"):
        (root / part).mkdir()
    for i in range(count):
        (root / "color" / f"{i:04d}.png").write_bytes(png(color(i)))
        (root / "depth" / f"{i:04d}.png").write_bytes(png(depth(i)))
        (root / "data" / f"{i:04d}.json").write_text(json.dumps({"header": {"secs": 1000 + 0.1 * i}}))
    K = [[10.0, 0, 4.0], [0, 11.0, 3.0], [0, 0, 1]]
    (root / name).write_text(json.dumps(config or {"cam_intr": K, "depth_scale": 4000, "im_w": 8, "im_h": 6}))
    return root


def test_a_folder_of_the_authors_is_played_back(tmp_path: Path) -> None:
    """Pictures, intrinsics with our pixel centres, depth scale and stamps are those of the folder."""
    camera = choose_camera(f"replay:{folder(tmp_path)}")
    assert isinstance(camera, ReplayCamera)
    frames = played(camera)
    assert camera.intrinsics == LENS and camera.depth_scale == 1 / 4000
    assert camera.rate_hz == pytest.approx(10.0)
    assert [frame.t_device for frame in frames] == pytest.approx([0, 0.1, 0.2])
    for i, frame in enumerate(frames):
        assert np.array_equal(frame.color, color(i)) and np.array_equal(frame.depth, depth(i))
        assert frame.number == i


def test_a_folder_of_open3d_is_played_back(tmp_path: Path) -> None:
    """The intrinsics of Open3D's recorder stand column by column, and it has no stamps: 30 a second."""
    matrix = [10.0, 0, 0, 0, 11.0, 0, 4.0, 3.0, 1]
    config = {"width": 8, "height": 6, "intrinsic_matrix": matrix, "depth_scale": 1000.0}
    root = folder(tmp_path, config=config, name="camera_intrinsic.json")
    for path in (root / "data").iterdir():
        path.unlink()
    made = folder_film(root)
    assert made.intrinsics == LENS and made.depth_scale == 0.001 and not made.stamped
    assert [t for _, _, t in made.pictures()] == pytest.approx([0, 1 / 30, 2 / 30])


K = [[10.0, 0, 4.0], [0, 11.0, 3.0], [0, 0, 1]]


@pytest.mark.parametrize(
    "config",
    [
        {}, {"cam_intr": [1, 2]}, {"cam_intr": np.zeros((3, 3)).tolist()}, {"cam_intr": K, "im_w": float("inf")},
        {"cam_intr": K, "depth_scale": 10**400},
    ],
    ids=["none", "few", "zero", "endless", "huge"],
)  # fmt: skip
def test_a_folder_without_geometry_is_refused(tmp_path: Path, config: dict[str, Any]) -> None:
    """No intrinsics, or such that no camera has."""
    root = folder(tmp_path)
    (root / "config.json").write_text(json.dumps(config))
    with pytest.raises(CameraError):
        folder_film(root)


def test_a_stamp_beyond_all_numbers_is_none(tmp_path: Path) -> None:
    """Its frame is left out, as one without a stamp."""
    root = folder(tmp_path)
    (root / "data" / "0001.json").write_text(json.dumps({"header": {"secs": 10**400}}))
    assert [t for _, _, t in folder_film(root).pictures()] == pytest.approx([0, 0.2])


def test_a_picture_that_goes_while_it_is_played_is_an_error_of_the_camera(tmp_path: Path) -> None:
    """Films are read in the thread of the feed, which hears no other error."""
    root = folder(tmp_path)
    camera = ReplayCamera(folder_film(root), paced=False)
    (root / "depth" / "0001.png").unlink()
    with pytest.raises(CameraError, match="played back") as caught:
        played(camera)
    assert "0001.png" in caught.value.where


def test_the_depth_scale_must_be_known(tmp_path: Path) -> None:
    """Where the configuration does not say it, it must be given."""
    K = [[10.0, 0, 4.0], [0, 11.0, 3.0], [0, 0, 1]]
    root = folder(tmp_path, config={"cam_intr": K, "im_w": 8, "im_h": 6})
    with pytest.raises(CameraError, match="played back"):
        folder_film(root)
    assert folder_film(root, depth_scale=0.001).depth_scale == 0.001


def test_a_recording_is_played_back() -> None:
    """Colour frames with the depth frames that they name, or none."""
    camera = Group(
        {"t": np.array([1.0, 2.0, 3.0]), "color": Blobs([png(color(i)) for i in range(3)], 3),
         "depth": Blobs([png(depth(i)) for i in range(2)], 2), "pair": np.array([1, -1, 0])},
        {"width": 8, "height": 6, "fx": 10.0, "fy": 11.0, "cx": 4.5, "cy": 3.5, "depth_scale": 0.001},
    )  # fmt: skip
    data = ArtifactData("recording", {"runs/a/caps": Group(), "runs/b/camera": camera})
    frames = played(ReplayCamera(recorded_film(data), paced=False))
    assert [int(frame.depth.max()) for frame in frames] == [1001, 0, 1000]
    assert [frame.t_device for frame in frames] == [1.0, 2.0, 3.0]
    with pytest.raises(CameraError):
        recorded_film(data, "a")


def test_the_pace_is_that_of_the_stamps() -> None:
    """A frame comes no earlier than its stamp says; a read that ends before gives None."""
    with ReplayCamera(film(rate=3.0)) as camera:
        begin = time.monotonic()
        assert camera.read(1.0) is not None
        assert camera.read(0.01) is None
        assert camera.read(1.0) is not None
        assert time.monotonic() - begin >= 0.33


def test_a_film_begins_again_with_rising_stamps() -> None:
    """In a loop numbers and stamps go on rising, and the pictures repeat."""
    with ReplayCamera(film(), loop=True) as camera:
        frames = [frame for _ in range(8) if (frame := camera.read(1.0)) is not None]
    assert [frame.number for frame in frames] == list(range(8))
    assert (np.diff([frame.t_device for frame in frames]) > 0.02).all()
    assert np.array_equal(frames[7].color, color(1))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (b"no picture", png(depth(0))),
        (png(color(0)), png(color(0))),
        (png(color(0)[:3]), png(depth(0))),
        (png(color(0)), b""),
    ],
    ids=["broken", "swapped", "size", "empty depth"],
)
def test_a_broken_frame_is_one_error(one: bytes, other: bytes) -> None:
    """What cannot be decoded, is no depth or has another size is named."""
    broken = Film("test", LENS, 0.001, 30.0, lambda: iter([(one, other, 0.0)]))
    with pytest.raises(CameraError, match="frame 0"), ReplayCamera(broken):
        pass


@pytest.mark.parametrize(
    "spec", ["", "webcam", "rig:", "rig://host", "rig://:9", "rig://h:99999", "rig://h:x", "replay:"]
)
def test_words_that_name_no_camera_are_refused(spec: str) -> None:
    """A usage error that lists what there is."""
    with pytest.raises(UsageError) as caught:
        choose_camera(spec)
    assert "rig://HOST:PORT" in caught.value.expected
