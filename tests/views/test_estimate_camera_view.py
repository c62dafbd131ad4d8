"""The picture of a camera run, with and without what it need not have."""

from __future__ import annotations

import struct

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.views.estimate_camera import draw_camera_run
from tests.guards.listing import ROOT

ESTIMATE = ROOT / "examples" / "sample-project" / "project" / "iterations" / "001" / "20-estimate.h5"
FRAMES = "runs/walk/frames"


def _height(png: bytes) -> int:
    """[px]"""
    return int(struct.unpack(">I", png[20:24])[0])


def test_sensors_that_spoke_too_rarely_are_left_out_of_the_picture() -> None:
    """No frame has a reading near enough (`estimate.sensor_gap_s`): the rest is drawn, without an empty half."""
    _, data = read_artifact(ESTIMATE)
    frames = data.groups[FRAMES]
    silent = {name: value for name, value in frames.datasets.items() if not name.startswith("sensor_")}
    assert len(silent) == len(frames.datasets) - 2 and data.group("walk", "sensor_fit") is not None
    groups = {**data.groups, FRAMES: Group(silent, frames.attributes)}
    found = draw_camera_run(ArtifactData("estimate", groups), "walk")
    assert found[:4] == b"\x89PNG"
    assert _height(found) < _height(draw_camera_run(data, "walk"))
