"""Frames that nobody takes: thrown away, or waited with."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Self

import numpy as np

from r2s2r_cli.devices.camera import Frame, Intrinsics
from r2s2r_cli.hardware.camera.feed import HELD, Feed


class Counting:
    """A camera that has `count` pictures at once, and says how many were read."""

    name = "counting"
    intrinsics = Intrinsics(width=4, height=3, fx=1.0, fy=1.0, cx=1.5, cy=1.0)
    depth_scale = 1e-3
    rate_hz = 30.0

    def __init__(self, count: int) -> None:
        self.count, self.read_so_far, self.begun = count, 0, threading.Event()

    def open(self) -> None:
        """Nothing to open."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to close."""

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next one; then nothing, after a while."""
        if not self.begun.is_set() or self.read_so_far == self.count:
            time.sleep(min(timeout_s, 0.01))
            return None
        self.read_so_far += 1
        k = self.read_so_far
        return Frame(np.full((3, 4, 3), k % 256, np.uint8), np.full((3, 4), k, np.uint16), k / 30, k / 30, k)

    def close(self) -> None:
        """Nothing to close."""


def until(true: Callable[[], bool], *, seconds: float = 30.0) -> bool:
    """Whether a condition came true in time."""
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.002)
    return true()


def _has(feed: Feed, count: int) -> bool:
    return feed.statistics.received == count


def test_a_feed_that_nobody_reads_keeps_the_newest() -> None:
    """200 pictures, room for 90: 110 are thrown away and counted."""
    camera = Counting(200)
    camera.begun.set()
    with Feed(camera) as feed:
        assert until(lambda: feed.statistics.received == 200)
        assert feed.statistics.overrun == 110
        assert [one.number for one in feed.frames()] == list(range(111, 201))


def test_a_feed_that_holds_loses_nothing() -> None:
    """The camera waits while there is no room: all 200 come, in order, to a reader that is slow."""
    camera = Counting(200)
    with Feed(camera) as feed:
        feed.hold(True)
        camera.begun.set()
        numbers: list[int] = [one.number for one in feed.frames()]
        while len(numbers) < 200:
            assert until(partial(_has, feed, len(numbers) + min(HELD, 200 - len(numbers))))
            assert camera.read_so_far <= len(numbers) + HELD + 1
            numbers += [one.number for one in feed.frames()]
        assert numbers == list(range(1, 201)) and feed.statistics.overrun == 0


def test_closing_a_feed_that_holds_ends_its_thread() -> None:
    """A full feed that waits is not waited for."""
    before = threading.active_count()
    camera = Counting(200)
    feed = Feed(camera)
    feed.hold(True)
    camera.begun.set()
    assert until(lambda: feed.statistics.received >= HELD)
    feed.close()
    assert threading.active_count() == before
