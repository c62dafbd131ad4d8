"""Many changed values of one file are one line, a few are told each."""

from __future__ import annotations

from r2s2r_cli.store.brief import brief
from r2s2r_cli.store.staleness import differences

OTHER = "input iterations/001/10-record.h5 changed: its content hash is another"


def changed(count: int, of: str = "robot.toml: ", top: str = "sensors") -> list[str]:
    """So many reasons of one kind, as `reasons` gives them."""
    old = {top: [{"offset_f": 0.0}] * count}
    new = {top: [{"offset_f": i + 1.0} for i in range(count)]}
    return [of + text for text in differences(old, new)]


def test_three_values_are_told_each() -> None:
    """And what is no value of a file always is, where it stood."""
    texts = [*changed(3), *[OTHER] * 5]
    assert brief(texts) == texts


def test_many_values_are_counted_with_an_example() -> None:
    """Eighteen numbers of a calibration are one line; another reason is told beside them, the order is kept."""
    assert brief([OTHER, *changed(18), "last"]) == [
        OTHER, "18 values of robot.toml changed (sensors.*), the first: sensors.0.offset_f was 0.0, is 1.0", "last",
    ]  # fmt: skip


def test_every_part_that_changed_is_named() -> None:
    """Settings apart from the robot, each part of it once."""
    assert brief([*changed(2), *changed(2, top="rods"), *changed(4, "setting identify.", "free")]) == [
        "4 values of robot.toml changed (sensors.*, rods.*), the first: sensors.0.offset_f was 0.0, is 1.0",
        "4 settings of identify changed (free.*), the first: free.0.offset_f was 0.0, is 1.0",
    ]
