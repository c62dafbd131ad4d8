"""Pictures beside the control loop: without loss where it is said, counted where lost, errors where they matter."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from r2s2r_cli.devices.camera import CameraError, FeedStatistics, Frame
from r2s2r_cli.devices.link import Sample
from r2s2r_cli.errors import ArtifactError, HardwareError
from r2s2r_cli.stages.record import Session, plans, writer as record_writer
from r2s2r_cli.stages.record.camera import LATE_S, Pictures, encode_color, encode_depth
from r2s2r_cli.stages.record.run import RunLoop
from r2s2r_cli.stages.record.writer import Writer
from r2s2r_cli.stages.simulate.policies import random_policy
from schemas.config import RecordSettings
from tests.support.fake_robot import FakeLink, Rows, calibrated

SHAPE = (24, 32)


class Still:
    """A feed that hands out prepared frames, a few at a time, and then an error or nothing."""

    def __init__(self, frames: Sequence[Frame], *, error: Exception | None = None) -> None:
        self.left, self.error, self.begun = list(frames), error, False
        self.statistics = FeedStatistics()
        self.holds: list[bool] = []

    def frames(self) -> list[Frame]:
        """None at the first call, which is for what came before the run."""
        if not self.begun:
            self.begun = True
            return []
        if not self.left and self.error is not None:
            raise self.error
        some, self.left = self.left[:2], self.left[2:]
        return some

    def hold(self, on: bool) -> None:
        """Kept for the test."""
        self.holds.append(on)

    def close(self) -> None:
        """Nothing to close."""


def frame(number: int, t: float) -> Frame:
    """Noise that the number fixes."""
    generator = np.random.default_rng(number)
    color = generator.integers(0, 256, (*SHAPE, 3), dtype=np.uint8)
    depth = generator.integers(0, 65536, SHAPE, dtype=np.uint16)
    return Frame(color, depth, t_device=900.0 + t, t_host=t, number=number)


def written(feed: Still, rows: Rows, *, until: int = 10**9) -> Pictures:
    """What becomes of the frames of a feed, in a run that begins at host time 0."""
    with Writer(rows) as writer:
        pictures = Pictures(feed, writer, "camera", RecordSettings(), lambda one: one.t_host)
        with pictures:
            end = time.monotonic() + 30.0
            while (feed.left or not feed.begun) and pictures.written < until and time.monotonic() < end:
                time.sleep(0.001)
    return pictures


def test_depth_comes_back_to_the_last_count() -> None:
    """All 16 bits of every pixel, noise included."""
    depth = frame(1, 0.0).depth
    assert np.array_equal(cv2.imdecode(np.frombuffer(encode_depth(depth), np.uint8), cv2.IMREAD_UNCHANGED), depth)


def test_colour_is_rgb_and_lossless_where_asked() -> None:
    """PNG gives the very pixels; JPEG of a smooth picture comes within a few counts; red stays red."""
    color = frame(1, 0.0).color
    png = encode_color(color, RecordSettings(color="png"))
    assert np.array_equal(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1], color)
    red = np.zeros((*SHAPE, 3), dtype=np.uint8)
    red[..., 0] = np.linspace(150, 250, SHAPE[1])[None]
    jpeg = cv2.imdecode(np.frombuffer(encode_color(red, RecordSettings()), np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert np.abs(jpeg.astype(int) - red).max() < 12


def test_every_frame_is_written_with_both_clocks() -> None:
    """Stamps of the run, of the camera, its own numbers, and the depth that belongs to each colour."""
    rows = Rows()
    pictures = written(Still([frame(i, 0.033 * (i - 10)) for i in range(11, 31)]), rows)
    assert pictures.written == 20 and pictures.lost == 0
    assert np.allclose(rows.column("camera", "t_device") - rows.column("camera", "t"), 900.0)
    assert rows.column("camera", "source_frame").tolist() == list(range(11, 31))
    assert rows.column("camera", "pair").tolist() == list(range(20))


def test_gaps_in_the_count_are_lost_frames() -> None:
    """Numbers 1, 2, 5, 9: five lost; a frame of before the run and one that comes twice are left out."""
    numbers = [(0, -0.1), (1, 0.1), (2, 0.2), (2, 0.2), (5, 0.5), (9, 0.9)]
    rows = Rows()
    pictures = written(Still([frame(n, t) for n, t in numbers]), rows)
    assert rows.column("camera", "source_frame").tolist() == [1, 2, 5, 9]
    assert pictures.lost == 5


def test_what_may_show_the_time_before_the_run_is_not_of_it() -> None:
    """Pictures are stamped when they come: one stamped a moment after the start was exposed before it, where the robot
    lay on another place; those from LATE_S on are all kept."""
    robot = calibrated()
    link, rows = FakeLink(robot), Rows()
    begun = link.now()
    feed = Still([frame(i, begun + 0.02 * i) for i in range(12)])
    read, end = link.read, time.monotonic() + 30.0

    def after_the_pictures(timeout: float) -> Sample | None:
        while feed.left and time.monotonic() < end:
            time.sleep(0.001)
        return read(timeout)

    link.read = after_the_pictures  # type: ignore[method-assign]
    plan = plans([random_policy(robot, 20, 0)], repeats=1, rest=0.0)
    Session(plan, robot, link, RecordSettings(camera_gone_s=60.0), feed=feed).record(rows)
    stamps = rows.column("runs/random-0/camera", "t")
    assert np.allclose(stamps, [0.02 * i for i in range(12) if 0.02 * i >= LATE_S - 1e-9]) and len(stamps) > 5


def test_a_camera_that_is_gone_ends_the_run() -> None:
    """Its own error comes out of the control loop, the motors are off, the frames before are written."""
    robot = calibrated()
    link, rows = FakeLink(robot), Rows()
    slow = link.read
    link.read = lambda timeout: (time.sleep(0.001), slow(timeout))[1]  # type: ignore[method-assign]
    gone = CameraError("the camera is gone", where="--camera", hint="plug it in")
    feed = Still([frame(i, 200.0 + i) for i in range(6)], error=gone)
    session = Session(
        plans([random_policy(robot, 20, 0)], repeats=1, rest=0.0), robot, link, RecordSettings(), feed=feed
    )
    with pytest.raises(CameraError, match="gone"):
        session.record(rows)
    assert not link.driven.any()
    assert len(rows.of["runs/random-0/camera"]) == 6
    run = session.runs[0]
    assert run.ended == "the camera is gone" and run.camera is not None and run.camera.frames == 6


@pytest.mark.parametrize("lock_step", [False, True])
def test_a_camera_that_hesitates_holds_the_motors(lock_step: bool) -> None:
    """No frame for longer than camera_hold_s: nothing is driven until the next one; in lock-step time itself waits."""
    robot = calibrated()
    link, feed = FakeLink(robot, lock_step=lock_step), Still([])
    feed.statistics = FeedStatistics(silent_s=0.5)

    def come(number: int, sample: Sample) -> Sample:
        if number > 50:
            feed.statistics = FeedStatistics(silent_s=0.0)
        return sample

    link.on_read = come
    plan = plans([random_policy(robot, 1, 0)], repeats=1, rest=0.0)
    session = Session(plan, robot, link, RecordSettings(camera_gone_s=60.0), feed=feed)
    session.record(Rows())
    (run,) = session.runs
    held = 0 if lock_step else 50
    assert run.held == held and run.complete and ("gave no frames" in "".join(run.warnings)) == bool(held)
    assert not np.array(link.commands[:held]).any() and np.any(link.commands[held])


def test_a_frozen_camera_is_said() -> None:
    """Frames that repeat the one before since the run began are counted, and warned of where they are many."""
    robot = calibrated()
    for repeats, said in ((2, False), (30, True)):
        link, feed = FakeLink(robot), Still([frame(i, 100.0 + 0.02 * i) for i in range(40)])
        feed.statistics = FeedStatistics(repeated=7)

        def freeze(number: int, sample: Sample, feed: Still = feed, repeats: int = repeats) -> Sample:
            feed.statistics = FeedStatistics(repeated=7 + repeats)
            return sample

        link.on_read = freeze
        plan = plans([random_policy(robot, 1, 0)], repeats=1, rest=0.0)
        session = Session(plan, robot, link, RecordSettings(), feed=feed)
        session.record(Rows())
        (run,) = session.runs
        assert run.camera is not None and run.camera.repeated == repeats
        assert any("frozen camera" in text for text in run.warnings) == said


def test_a_silent_camera_ends_the_run() -> None:
    """No frame for longer than camera_gone_s."""
    robot = calibrated()
    link = FakeLink(robot)
    slow = link.read
    link.read = lambda timeout: (time.sleep(0.002), slow(timeout))[1]  # type: ignore[method-assign]
    session = Session(
        plans([random_policy(robot, 20, 0)], repeats=1, rest=0.0), robot, link, RecordSettings(camera_gone_s=0.1),
        feed=Still([]),
    )  # fmt: skip
    with pytest.raises(HardwareError, match="no frames"):
        session.record(Rows())
    assert not link.driven.any()


@pytest.mark.parametrize(("waits", "silent_s", "gone"), [(False, 1.0, False), (False, 3.0, True), (True, 3.0, False),
                                                         (True, 61.0, True)])  # fmt: skip
def test_in_lock_step_a_slow_camera_is_not_gone(
    waits: bool, silent_s: float, gone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot's time stands still until the picture is there; two seconds of a busy machine had ended the run."""
    pictures = Pictures(Still([]), Writer(Rows()), "camera", RecordSettings(), lambda frame: 0.0, waits=waits)  # type: ignore[arg-type]
    begun = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: begun + silent_s)
    if gone:
        with pytest.raises(HardwareError, match="no frames"):
            pictures.check()
    else:
        pictures.check()


def test_a_writer_waits_for_its_rows_and_says_what_the_disk_said() -> None:
    """All rows are with the sink at the end of the context; a refusal comes out as a hardware error, once."""
    rows = Rows()

    def slow(stream: str, row: object) -> None:
        time.sleep(0.001)
        rows(stream, row)

    with Writer(slow) as writer:
        for i in range(50):
            writer.put("s", {"i": i})
    assert rows.column("s", "i").tolist() == list(range(50))

    def full(stream: str, row: object) -> None:
        raise ArtifactError("the disk is full", where="journal", hint="df -h .")

    with pytest.raises(HardwareError, match="cannot be written") as caught, Writer(full) as writer:
        writer.put("s", {"i": 0})
    assert caught.value.received == "the disk is full"


def test_a_disk_that_stands_still_is_an_error_not_a_wait() -> None:
    """A robot in real time is not held up: more than 4000 rows in memory end the run; in lock-step the sender waits."""
    import threading

    gate = threading.Event()

    def stuck(stream: str, row: object) -> None:
        gate.wait(5.0)

    with pytest.raises(HardwareError, match="too slow"), Writer(stuck) as writer:
        try:
            for i in range(10_000):
                writer.put("s", {"i": i})
        finally:
            gate.set()
    rows = Rows()
    with Writer(rows, lossless=True) as writer:
        for i in range(10_000):
            writer.put("s", {"i": i})
    assert len(rows.of["s"]) == 10_000


def test_in_lock_step_no_row_is_dropped_in_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that takes nothing for longer than a robot in lock-step waits ends the run: every row that was taken until
    then is with the sink."""
    import threading

    monkeypatch.setattr(record_writer, "MAX_ROWS", 3)
    monkeypatch.setattr(record_writer, "PATIENCE_S", 0.05)
    gate, rows, taken = threading.Event(), Rows(), 0

    def stuck(stream: str, row: Mapping[str, Any]) -> None:
        gate.wait(5.0)
        rows(stream, row)

    with pytest.raises(HardwareError, match="too slow"), Writer(stuck, lossless=True) as writer:
        try:
            for i in range(10):
                writer.put("s", {"i": i})
                taken += 1
        finally:
            gate.set()
    assert 0 < taken < 10 and rows.column("s", "i").tolist() == list(range(taken))


def test_in_lock_step_a_frame_that_has_waited_shifts_no_clock() -> None:
    """The first frame of a second run was taken before it: it lies before the run, and the others where they were."""
    robot = calibrated()
    link = FakeLink(robot, lock_step=True)
    now = 0.0
    link.now = lambda: now  # type: ignore[method-assign]
    session = Session([], robot, link, RecordSettings())

    def begun(at: float) -> RunLoop:
        return SimpleNamespace(link=link, elapsed=lambda: now - at)  # type: ignore[return-value]

    first = session._stamp(begun(0.0))
    now = 0.02
    assert first(frame(0, 0.0)) == pytest.approx(0.02)
    assert first(frame(1, 0.1)) == pytest.approx(0.12)
    now = 30.0
    second = session._stamp(begun(30.0))
    now = 30.02
    assert second(frame(299, 29.9)) == pytest.approx(-0.08)
    assert second(frame(300, 30.0)) == pytest.approx(0.02)


@pytest.mark.parametrize("lock_step", [False, True])
def test_in_lock_step_the_camera_waits_for_the_writer(lock_step: bool) -> None:
    """While a run is on the feed holds the camera; in real time never, and never after the run."""
    robot = calibrated()
    feed = Still([frame(k, 0.1 + k / 30) for k in range(4)])
    plan = plans([random_policy(robot, 1, 0)], repeats=2, rest=0.0)
    Session(plan, robot, FakeLink(robot, lock_step=lock_step), RecordSettings(camera_gone_s=60.0), feed=feed).record(
        Rows()
    )
    assert feed.holds == [lock_step, False] * 2
