"""Pictures of a recording as frames: decoding, pairing, what is refused; residuals and lengths for the report."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.camera_input import kept_frames, sensor_readings
from r2s2r_cli.stages.estimate.images import AHEAD, DecodedFrames
from r2s2r_cli.stages.estimate.sweep import FRESH_S, _at_frames
from tests.stages.estimate.builders import threebar

LENS = Intrinsics(8, 6, 10.0, 10.0, 4.0, 3.0)
FACTS = {"width": 8, "height": 6, "fx": 10.0, "fy": 10.0, "cx": 4.0, "cy": 3.0, "depth_scale": 0.001}


def color_png(number: int) -> bytes:
    """Red as large as the number, in a picture of 8 x 6."""
    image = np.zeros((6, 8, 3), np.uint8)
    image[:, :, 2] = number
    return cv2.imencode(".png", image)[1].tobytes()


def depth_png(number: int, size: tuple[int, int] = (6, 8)) -> bytes:
    """Depth counts 1000 + number."""
    return cv2.imencode(".png", np.full(size, 1000 + number, np.uint16))[1].tobytes()


def source(n: int = 12, **changes: object) -> DecodedFrames:
    """n frames that tell their number."""
    made = DecodedFrames(
        lens=LENS, depth_scale=0.001, t=0.1 * np.arange(n), color=[color_png(k) for k in range(n)],
        depth=[depth_png(k) for k in range(n)], pair=np.arange(n),
    )  # fmt: skip
    return replace(made, **changes)


def recorded(t: Sequence[float], **datasets: np.ndarray) -> dict[str, Group]:
    """Streams of a run with a camera."""
    return {"": Group(), "camera": Group({"t": np.array(t), **datasets}, FACTS)}


def test_frames_come_in_order_as_rgb_and_counts() -> None:
    """PNG stores what was encoded; OpenCV's BGR is turned."""
    frames = list(source())
    assert [frame.index for frame in frames] == list(range(12))
    for k, frame in enumerate(frames):
        assert frame.color is not None and frame.depth is not None
        assert (frame.color == (k, 0, 0)).all() and (frame.depth == 1000 + k).all()
        assert frame.t == pytest.approx(0.1 * k)


def test_decoding_stays_a_few_frames_ahead() -> None:
    """Whoever takes one frame has made no more than AHEAD and the two in hand be decoded: memory does not grow."""
    decoded: list[int] = []

    class Counting(list[bytes]):
        def __getitem__(self, index: int) -> bytes:  # type: ignore[override]
            decoded.append(index)
            return super().__getitem__(index)

    frames = iter(source(40, color=Counting(color_png(k) for k in range(40))))
    first = next(frames)
    frames.close()  # type: ignore[attr-defined]
    assert first.index == 0
    assert len(decoded) <= AHEAD + 2
    assert not [thread for thread in threading.enumerate() if thread.name == "estimate-frames"]


def test_a_broken_picture_is_missing_and_one_of_another_size_an_error() -> None:
    """What cannot be decoded counts as not there; what is not of this camera is refused with the words for it."""
    color = [color_png(k) for k in range(12)]
    color[3] = color[3][:20]
    color[4] = b""
    frames = list(source(color=color))
    assert [frame.index for frame in frames if frame.color is None] == [3, 4]
    with pytest.raises(InputError, match="depth picture 5"):
        list(source(depth=[depth_png(k, (6, 8) if k != 5 else (3, 4)) for k in range(12)]))
    with pytest.raises(InputError, match="swapped"):
        list(source(depth=[color_png(k) for k in range(12)]))


def test_frames_without_depth_have_none() -> None:
    """-1 in `pair`, and a number beyond the last depth picture."""
    frames = list(source(pair=np.array([0, -1, 2, 99, *range(4, 12)])))
    assert [frame.index for frame in frames if frame.depth is None] == [1, 3]


def test_close_frames_are_left_out_and_numbers_are_those_of_the_recording() -> None:
    """Two stamps 5 ms apart are one observation; the second is dropped, and later pictures stay with their stamps."""
    t = [0.0, 0.033, 0.038, 0.066, 0.1, 0.133, 0.166]
    pictures = {"color": [color_png(k) for k in range(7)], "depth": [depth_png(k) for k in range(7)]}
    rows, frames = kept_frames("walk", recorded(t), lambda run, name: pictures[name])
    assert rows.tolist() == [0, 1, 3, 4, 5, 6]
    frame = frames.frame(2)
    assert frame.color is not None and frame.depth is not None
    assert (frame.color[0, 0, 0], frame.depth[0, 0], frame.t) == (3, 1003, 0.066)


def test_depth_is_paired_by_stamps_where_the_recording_does_not_pair() -> None:
    """The nearest within 20 ms; a depth stream that began late leaves the first frames without."""
    t = 0.1 * np.arange(6)
    pictures = {"color": [color_png(k) for k in range(6)], "depth": [depth_png(k) for k in range(4)]}
    streams = recorded(t, t_depth=t[2:] + 0.004)
    _, frames = kept_frames("walk", streams, lambda run, name: pictures[name])
    assert frames.pair.tolist() == [-1, -1, 0, 1, 2, 3]


@pytest.mark.parametrize(
    ("missing", "words"),
    [("fx", "no fx"), ("depth_scale", "no depth_scale")],
)
def test_a_camera_that_is_not_described_is_refused(missing: str, words: str) -> None:
    """Without geometry or the unit of depth nothing has a size."""
    facts = {name: value for name, value in FACTS.items() if name != missing}
    streams = {"camera": Group({"t": 0.1 * np.arange(6)}, facts)}
    with pytest.raises(InputError) as caught:
        kept_frames("walk", streams, lambda run, name: [b""] * 6)
    assert caught.value.received == words


def test_pictures_that_are_missing_are_named() -> None:
    """Depth alone is not enough, colour alone neither."""
    with pytest.raises(InputError, match="no depth pictures"):
        kept_frames("walk", recorded([0.0, 0.1]), lambda run, name: [b""] if name == "color" else None)


def test_readings_leave_out_what_is_no_length() -> None:
    """A chip that is not initialised gives 0.20 pF, by its line a negative length; a row without any is left out."""
    robot = threebar()
    length = np.full((4, 9), np.nan)
    length[0], length[1, 2], length[3] = 0.2, -0.4, 0.21
    readings = sensor_readings({"sensors": Group({"t": 0.02 * np.arange(4), "length": length})}, robot)
    assert readings is not None
    assert readings.t.tolist() == [0.0, 0.02, 0.06]
    assert np.isnan(readings.length[1]).all()
    assert readings.cable.tolist() == [sensor.cable for sensor in robot.sensors]
    assert sensor_readings({"sensors": Group({"t": np.zeros(1), "length": np.full((1, 9), np.nan)})}, robot) is None


def test_lengths_at_a_frame_are_the_median_of_the_last_moments() -> None:
    """Boards take turns: each sensor's own samples count, as far back as FRESH_S and never from after the frame."""
    robot = threebar()
    t = np.arange(10) * 0.02
    length = np.full((10, 9), np.nan)
    length[::2, 0] = np.arange(5) * 0.01 + 0.1
    readings = sensor_readings({"sensors": Group({"t": t, "length": length})}, robot)
    found = _at_frames(np.array([0.081, 0.35]), readings)
    since = [k for k in range(0, 10, 2) if 0.081 - FRESH_S < t[k] <= 0.081]
    assert found[0, 0] == pytest.approx(np.median(length[since, 0]))
    assert np.isnan(found[0, 1]) and np.isnan(found[1]).all()
