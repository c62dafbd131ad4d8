"""What an import says of every format, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Value
from r2s2r_cli.stages.import_ import import_source, merge_runs
from r2s2r_cli.views.figure import new_figure, png_bytes, spread_out
from r2s2r_cli.views.recording import draw_recording, ground_offset, import_rows, import_title
from r2s2r_cli.views.recording_streams import Panel, draw_streams, panels, received
from tests.support.import_samples import (
    SIDECAR,
    frame_json,
    sample_robot,
    small_csv,
    write_authors_folder,
    write_image,
    write_tum_folder,
)


def _source(kind: str, folder: Path) -> Path:
    if kind == "authors_folder":
        return write_authors_folder(folder / "walk", [frame_json(1676990000.0 + 0.1 * i) for i in range(8)])
    if kind == "tum_rgbd":
        stamps = (5.0 + 0.1 * np.arange(8)).tolist()
        return write_tum_folder(folder / "walk", stamps, stamps)
    folder.mkdir(exist_ok=True)
    path = folder / "walk.csv"
    path.write_text(small_csv())
    path.with_suffix(".toml").write_text(SIDECAR)
    return path


@pytest.mark.parametrize("kind", ["trajectory_csv", "authors_folder", "tum_rgbd"])
def test_the_report_of_every_format_becomes_rows(kind: str, tmp_path: Path) -> None:
    """Rods and ground are said where end caps were observed, and only there; frames always."""
    report = import_source(_source(kind, tmp_path), robot=sample_robot()).report
    rows = dict(import_rows(report))
    assert report.format == kind
    assert rows["frames kept"].startswith(f"{report.kept} of {report.rows} rows")
    assert ("rod 0" in rows) == ("ground offset" in rows) == (kind == "trajectory_csv")


def test_what_a_sidecar_says_is_quoted(tmp_path: Path) -> None:
    """A path in it is seen from there: it is not said as if it were one of the project."""
    report = import_source(_source("trajectory_csv", tmp_path), robot=sample_robot()).report
    said = import_title(report.model_copy(update={"source": "measured by us; see ../README.md"}))
    assert said == 'run walk, its sidecar beside the log says: "measured by us; see ../README.md"'


def test_the_side_of_the_ground_follows_the_sign() -> None:
    """A positive offset lifts caps that lie too low, a negative one lowers caps that lie too high."""
    assert ground_offset(0.004) == "+4.0 mm to add to z: the lowest cap lies 4.0 mm too low on average"
    assert ground_offset(-0.746) == "-746.0 mm to add to z: the lowest cap lies 746.0 mm too high on average"


@pytest.mark.parametrize("kind", ["authors_folder", "tum_rgbd"])
def test_camera_frames_are_drawn(kind: str, tmp_path: Path) -> None:
    """The picture of a camera run shows its frames: another image gives another picture, the same one the same."""
    source = _source(kind, tmp_path)
    before = _drawn(source)
    assert before.startswith(b"\x89PNG")
    assert _drawn(source) == before
    first = sorted((source / ("color" if kind == "authors_folder" else "rgb")).iterdir())[0]
    write_image(first, depth=False, value=99)
    assert _drawn(source) != before


def test_depth_without_a_partner_and_frames_that_cannot_be_decoded_are_drawn(tmp_path: Path) -> None:
    """A colour frame without depth, and bytes that are no image, do not stop the drawing."""
    source = _source("tum_rgbd", tmp_path)
    camera = _recording(source).groups["runs/walk/camera"]
    spoilt: dict[str, Value] = {
        "pair": np.full(8, -1, dtype=np.int64),
        "color": Blobs([b"no image", *[b""] * 7], 8),
    }
    changed = Group({**camera.datasets, **spoilt}, camera.attributes)
    data = ArtifactData("recording", {**_recording(source).groups, "runs/walk/camera": changed})
    assert dict(draw_recording(data, 0.0175))["walk"].startswith(b"\x89PNG")


def test_what_the_robot_sent_is_drawn(tmp_path: Path) -> None:
    """Motors, sensors, inertial units and motion capture have a panel each, with the unit in its title."""
    titles = [panel.title for panel in panels(_recording(_source("authors_folder", tmp_path)), "walk")]
    for words in ("position", "encoder length [mm]", "sensor length [mm]", "capacitance [pF]", "specific force", "mm]"):
        assert any(words in title for title in titles), words
    assert panels(_recording(_source("trajectory_csv", tmp_path / "other")), "walk") == []


def test_what_was_sent_shares_its_time_with_the_commands() -> None:
    """Of a run without end caps: the diagrams begin and end at the same places of the picture and at the same times.
    Nine sensors have nine colours, and the dashes of the last three no dots between them."""
    t = np.linspace(0.0, 5.0, 200)
    nine = Panel("length", [t] * 9, [t + k for k in range(9)], [f"sensor {k}" for k in range(9)])
    figure = new_figure(10.0, 6.0)
    (part,) = figure.subfigures(1, 1, squeeze=False)[:, 0]
    draw_streams(part, [nine, nine], None, above=lambda axes: axes.plot([0.0, 9.0], [0.0, 1.0])[0].set_label("target"))
    png_bytes(figure)
    axes = part.axes
    assert (
        len({(round(one.get_position().x0, 6), round(one.get_position().x1, 6), one.get_xlim()) for one in axes}) == 1
    )
    lines = axes[1].get_lines()
    assert len({line.get_color() for line in lines}) == 9
    assert {(line.get_linestyle(), line.get_marker()) for line in lines[6:]} == {("--", "")}


def test_a_row_in_which_others_were_received_is_no_gap() -> None:
    """Sensors that take turns are lines all the same; a silence of a second is a gap, in whatever is not that slow."""
    t = 0.05 * np.arange(80)
    turns = np.where(np.arange(80) % 2, np.nan, t)
    silent = np.where((t > 1.0) & (t < 2.0), np.nan, t)
    slow = 20.0 * t
    (fast, cut, rare), lines = received(Panel("", [t, t, slow], [turns, silent, slow], ["a", "b", "c"]))
    assert np.isfinite(fast).all() and len(fast) == 40 and np.isfinite(rare).all()
    assert np.isnan(cut).sum() == np.isnan(lines[1]).sum() == 1


def test_a_recording_whose_pictures_were_taken_out_is_drawn(tmp_path: Path) -> None:
    """The times of its frames stay, and are no picture."""
    data = _recording(_source("authors_folder", tmp_path))
    camera = data.groups["runs/walk/camera"]
    kept = {name: values for name, values in camera.datasets.items() if not isinstance(values, Blobs)}
    groups = {**data.groups, "runs/walk/camera": Group(kept, camera.attributes)}
    assert dict(draw_recording(ArtifactData("recording", groups), 0.0175))["walk"].startswith(b"\x89PNG")


@pytest.mark.parametrize("empty", [("depth",), ("color", "depth")])
def test_a_camera_that_failed_before_its_first_frame_is_left_out(tmp_path: Path, empty: tuple[str, ...]) -> None:
    """Streams without a picture stop neither the drawing of the other one nor that of the robot's."""
    data = _recording(_source("authors_folder", tmp_path))
    camera = data.groups["runs/walk/camera"]
    gone: dict[str, Value] = {name: Blobs([], 0) for name in empty}
    if "color" in empty:
        gone |= {"t": np.zeros(0), "pair": np.zeros(0, dtype=np.int64), "source_frame": np.zeros(0, dtype=np.int64)}
    if "depth" in empty:
        gone["t_depth"] = np.zeros(0)
    groups = {**data.groups, "runs/walk/camera": Group({**camera.datasets, **gone}, camera.attributes)}
    assert dict(draw_recording(ArtifactData("recording", groups), 0.0175))["walk"].startswith(b"\x89PNG")


def test_numbers_that_would_overlap_are_left_out() -> None:
    """Of points in a row every one far enough from those taken before is taken, the first always."""
    points = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.2], [3.0, 0.0]])
    assert spread_out(points, 1.0) == [0, 2, 4]
    assert spread_out(points, 0.0) == [0, 1, 2, 3, 4]


def _recording(source: Path) -> ArtifactData:
    return merge_runs([import_source(source, robot=sample_robot())])


def _drawn(source: Path) -> bytes:
    return dict(draw_recording(_recording(source), 0.0175))["walk"]
