"""Camera runs of the rig from pictures to states: accuracy, what is marked, what is refused, what is drawn.

The runs are those of `bench estimate`, of its tuning seeds; bounds are several times what was measured there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.bench_estimate_case import TUNING_SEEDS, Case, make_case
from r2s2r_cli.commands.bench_estimate_score import errors_of, summed_up
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.estimate.camera_run import tracked_run
from r2s2r_cli.stages.estimate.groups import run_groups
from r2s2r_cli.stages.estimate.report import run_report
from r2s2r_cli.stages.estimate.run import RunState
from r2s2r_cli.stages.estimate.sweep import Sweep
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.store.frames import PictureFile
from r2s2r_cli.store.layout import check_layout
from r2s2r_cli.store.write import write_artifact
from r2s2r_cli.views.estimate_camera import draw_camera_run
from r2s2r_cli.views.estimate_overlay import FILM_FRAMES, Model, overlay_film, overlay_strip
from r2s2r_cli.views.estimate_page import report_tables
from schemas.estimate import ESTIMATE, EstimateSettings
from schemas.results_estimate import EstimateReport
from schemas.results_estimate_bench import TrackScore
from tests.support import spoiled
from tests.support.builders import provenance, recording
from tests.support.spoiled import Spoiled, during

SEED, RUN_S = TUNING_SEEDS[0], 4.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the drawn pictures are kept."""
    return tmp_path_factory.mktemp("cases")


@pytest.fixture(scope="module")
def case(folder: Path) -> Case:
    """A run of 4 s at 1.44 m: at rest for 1.5 s, then two targets."""
    return make_case(SEED, folder, run_s=RUN_S)


@pytest.fixture(scope="module")
def state(case: Case) -> RunState:
    """Its states."""
    return tracked(case)


def tracked(case: Case, **changes: Any) -> RunState:
    """The states of a case, of which something may be spoiled."""
    source = Spoiled(case.frames, **changes) if changes else case.frames
    return tracked_run("case", case.streams, source, case.robot, EstimateSettings())


def score(case: Case, state: RunState) -> TrackScore:
    """How far they are from the truth."""
    groups = {path.removeprefix("runs/case/"): group for path, group in run_groups(state).items()}
    return summed_up([errors_of(case, groups, wall_s=1.0, cpu_s=1.0, memory_mb=0.0)])


def artifact(state: RunState) -> ArtifactData:
    """As it is written."""
    return ArtifactData("estimate", run_groups(state))


def marked(state: RunState, bit: int) -> np.ndarray:
    """Frames that have a bit of `frames/mode`."""
    return (run_groups(state)["runs/case/frames"]["mode"] & bit) > 0


@pytest.mark.slow
def test_caps_are_found_within_millimetres(case: Case, state: RunState) -> None:
    """Nobody tells the tracker where the robot or the camera is."""
    found = score(case, state)
    assert found.cap_mean_mm < 2.0
    assert found.cap_p95_mm < 6.0
    assert (found.within, found.lost) == (1.0, 0.0)
    assert found.contact_f1 is not None and found.contact_f1 > 0.9


@pytest.mark.slow
def test_world_has_its_floor_at_zero_and_the_camera_above_it(case: Case, state: RunState) -> None:
    """The height of the camera to 3 mm, its axis to the vertical to 0.1 degrees, as the case has them."""
    assert state.camera is not None
    X_WC = state.camera.X_WC
    assert X_WC[2, 3] == pytest.approx(case.truth.X_WC[2, 3], abs=0.003)
    assert np.degrees(np.arccos(-X_WC[2, 2])) < 0.1
    np.testing.assert_allclose(X_WC[:3, :3] @ X_WC[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.slow
def test_artifact_has_the_layout_of_its_schema(state: RunState, tmp_path: Path) -> None:
    """Written, read back, compared with the schema; rods rigid; what was known at a frame is finite for every cap."""
    import h5py

    path = tmp_path / ESTIMATE.filename
    write_artifact(path, artifact(state), provenance(stage="estimate"))
    with h5py.File(path) as file:
        assert check_layout(file, ESTIMATE) == []
    groups = run_groups(state)
    p_WE = groups["runs/case/frames"]["p_WE"]
    length = np.linalg.norm(p_WE[:, 1::2] - p_WE[:, 0::2], axis=-1)
    np.testing.assert_allclose(length, state.robot.rods[0].length_m, atol=1e-6)
    assert np.isfinite(groups["runs/case/tracks"]["observed"]).all()
    assert (groups["runs/case/tracks"]["observed_sd"] > 0).all()


@pytest.mark.slow
def test_what_was_known_at_a_frame_depends_on_no_later_one(case: Case, state: RunState) -> None:
    """The same run cut after 2.5 s knows the same at every frame up to there."""
    n = int(np.sum(case.frames.t < 2.5))
    short = tracked(case, rows=np.arange(n))
    whole, part = (run_groups(one)["runs/case/tracks"] for one in (state, short))
    # The look over the run before tracking (ground, noise, depth against colour) takes other frames: 0.5 mm.
    np.testing.assert_allclose(part["observed"], whole["observed"][:n], atol=2e-3)


@pytest.mark.slow
def test_report_and_pictures(case: Case, state: RunState) -> None:
    """Tables name every cap and sensor; the drawn model lies where the truth is in the picture."""
    report = EstimateReport(runs=(run_report(state),))
    titles = [table.title for table in report_tables(report)]
    assert titles == ["run case", "run case: camera", "run case: sightings",
                      "run case: cable sensors against the camera", "run case: end caps"]  # fmt: skip
    assert EstimateReport.model_validate(report.model_dump(mode="json")) == report
    data = artifact(state)
    assert draw_camera_run(data, "case")[:4] == b"\x89PNG"
    strip = overlay_strip(data, "case", case.robot, case.frames.color_of)
    assert strip is not None and cv2.imdecode(np.frombuffer(strip, np.uint8), cv2.IMREAD_COLOR) is not None
    model, lens = Model(data, "case", case.robot), case.frames.lens
    X_WC = case.truth.X_WC
    p_CE = (case.truth.p_WE - X_WC[:3, 3]) @ X_WC[:3, :3]
    true = np.stack(
        [lens.fx * p_CE[..., 0] / p_CE[..., 2] + lens.cx, lens.fy * p_CE[..., 1] / p_CE[..., 2] + lens.cy], -1
    )
    drawn, _ = model._projected(run_groups(state)["runs/case/frames"]["p_WE"][-1])
    assert np.abs(drawn - true[-1]).max() < 3.0


@pytest.mark.slow
def test_film_has_every_frame(case: Case, state: RunState, tmp_path: Path) -> None:
    """MP4 that OpenCV reads back."""
    film = overlay_film(artifact(state), "case", case.robot, case.frames.color_of)
    assert film is not None
    (tmp_path / "film.mp4").write_bytes(film)
    video = cv2.VideoCapture(str(tmp_path / "film.mp4"))
    count = 0
    while video.read()[0]:
        count += 1
    assert count == len(case.frames) <= FILM_FRAMES


@pytest.mark.slow
@pytest.mark.parametrize("change", [spoiled.no_picture, spoiled.black, spoiled.empty])
def test_frames_without_the_robot_are_marked_and_bridged(
    case: Case, change: Callable[[Any], Any], state: RunState
) -> None:
    """Half a second without anything to see, in motion: marked as blind, and no cap is more than 5 cm off."""
    broken = tracked(case, change=during(2.0, 2.5, change))
    away = (case.frames.t >= 2.0) & (case.frames.t < 2.5)
    assert marked(broken, 4)[away].all()
    assert not marked(state, 4).any()
    assert (marked(broken, 16) == (away & (change is not spoiled.empty))).all()
    found = score(case, broken)
    assert found.lost == 0.0
    assert found.cap_mean_mm < 4.0


@pytest.mark.slow
def test_states_end_where_the_robot_leaves_the_picture_for_good(case: Case, state: RunState) -> None:
    """What would be guessed from there on spoils nothing that was seen before, and the interval in which it left is
    neither trained on nor judged."""
    gone = tracked(case, change=during(2.0, 99.0, spoiled.empty))
    assert 1.9 < gone.t[-1] < 2.0
    assert any(
        "left the picture at 1.9" in text or "left the picture at 2.0" in text for text in run_report(gone).warnings
    )
    assert gone.intervals is not None and gone.segments is not None and state.intervals is not None
    assert not gone.intervals.complete[-1] and not gone.segments.complete[-1]
    assert len(gone.intervals) <= len(state.intervals)
    n = len(gone.t)
    away = np.linalg.norm(gone.p_WE - state.p_WE[:n], axis=2)
    assert away.max() < 0.004 and away.mean() < 5e-4


@pytest.mark.slow
def test_tracking_begins_where_the_caps_are_seen_and_goes_back(case: Case) -> None:
    """The first second is black: the caps are told apart after it, the frames before are marked."""
    late = tracked(case, change=during(-1.0, 1.0, spoiled.black))
    assert late.camera is not None
    assert late.t[late.camera.swept.first] >= 1.0
    assert marked(late, 4)[late.t < 0.9].all()
    assert score(case, late).lost == 0.0


@pytest.mark.slow
def test_a_first_picture_of_another_place_costs_that_frame_alone(case: Case) -> None:
    """The robot is put 0.27 m away after the first picture: it is found again, and all later frames are as they should
    be (the first one is where its picture shows it, which is not where the robot was)."""

    def elsewhere(frame: ImageFrame) -> ImageFrame:
        assert frame.color is not None
        assert frame.depth is not None
        color, depth = (np.roll(picture, (60, 120), axis=(0, 1)) for picture in (frame.color, frame.depth))
        return dataclasses.replace(frame, color=color, depth=depth)

    state = tracked(case, change=during(-1.0, float(case.frames.t[1]), elsewhere))
    assert not marked(state, 4).any()
    assert state.camera is not None
    assert 1 <= state.camera.swept.searched.sum() <= 3
    found = score(case, state)
    assert found.lost == pytest.approx(1 / len(case.frames))
    assert found.cap_p95_mm < 6.0


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "black": ({"change": spoiled.black}, "no frame of the run"),
    "no depth": ({"change": spoiled.no_depth}, "no frame of the run"),
    "saturated": ({"change": spoiled.saturated}, "no frame of the run"),
    "swapped": ({"change": spoiled.swapped}, "no cap"),
    "red and blue swapped": ({"change": spoiled.bgr}, "no cap"),
    "out of view": ({"change": spoiled.empty}, "no cap"),
    "unit four times": ({"scale": 4.0}, "large as their depth"),
    "unit a quarter": ({"scale": 0.25}, "large as their depth"),
    "unit 5 % off": ({"scale": 1.05}, "rods look"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_tracked_is_refused_with_the_way_out(case: Case, name: str) -> None:
    """A clear error, never a confident wrong pose."""
    changes, words = REFUSED[name]
    with pytest.raises(InputError, match=words) as caught:
        tracked(case, **changes)
    assert caught.value.hint.startswith("r2s2r ")


@pytest.mark.slow
def test_caps_taken_for_each_other_at_the_start_get_their_names_back(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both caps of every rod: what a prism at rest looks like after half a turn. The run is tracked all the same."""
    begin = Sweep._begin

    def turned(self: Sweep, frame: Any) -> np.ndarray | None:
        found = begin(self, frame)
        return None if found is None else found[[1, 0, 3, 2, 5, 4]]

    monkeypatch.setattr(Sweep, "_begin", turned)
    state = tracked(case)
    found = score(case, state)
    assert found.lost == 0.0
    assert found.cap_mean_mm < 2.0
    assert any("taken for each other" in text for text in run_report(state).warnings)


@pytest.mark.slow
@pytest.mark.parametrize("order", [(1, 0, 2), (1, 2, 0)])
def test_colours_of_other_rods_are_refused_and_named(case: Case, order: tuple[int, ...]) -> None:
    """Two exchanged, three rotated: every picture fits such a robot, but the sensors do not."""
    rods = [rod.name for rod in case.robot.rods]
    of = {color.rod: color for color in case.robot.colors}
    wrong = tuple(of[rods[other]].model_copy(update={"rod": rods[rod]}) for rod, other in enumerate(order))
    robot = case.robot.model_copy(update={"colors": wrong})
    with pytest.raises(InputError, match=r"exchanged: .*rod red has that of rod") as caught:
        tracked_run("case", case.streams, case.frames, robot, EstimateSettings())
    assert f"rod {rods[order[0]]} has that of rod {rods[0]}" in caught.value.what


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.2, 1.05, 1 / 1.5])
def test_a_wrong_focal_length_is_refused(case: Case, share: float) -> None:
    """Rods are rigid: their length in the pictures tells."""
    lens = case.frames.lens
    wrong = dataclasses.replace(lens, fx=lens.fx * share, fy=lens.fy * share)
    with pytest.raises(InputError, match=r"rods look|large as their depth"):
        tracked(case, lens_=wrong)


@pytest.mark.slow
def test_without_sensors_the_camera_is_enough_and_frames_say_so(folder: Path) -> None:
    """Labels come from the shape at rest."""
    case = make_case(SEED, folder, run_s=3.0, cables=False)
    state = tracked(case)
    found = score(case, state)
    assert found.cap_mean_mm < 2.5
    assert marked(state, 1).all()
    assert found.sensor_error_mm is None and found.delay_error_ms is None


def test_pictures_of_an_artifact_by_number(tmp_path: Path) -> None:
    """Any order, the bytes that were written; what is no picture is None."""
    data = recording()
    path = tmp_path / "10-record.h5"
    write_artifact(path, data, provenance(stage="record"))
    run = data.runs()[0]
    images = list(data.groups[f"runs/{run}/camera"].datasets["color"].items)  # type: ignore[union-attr]
    with PictureFile(path) as file:
        pictures = file.pictures(f"runs/{run}/camera/color")
        assert pictures is not None and len(pictures) == len(images)
        for k in (3, 0, len(images) - 1):
            assert pictures[k] == images[k]
        assert file.pictures(f"runs/{run}/camera/t") is None
        assert file.pictures("runs/nobody/camera/color") is None


@pytest.mark.slow
def test_a_run_in_which_the_robot_is_not_seen_costs_no_other(case: Case) -> None:
    """It is left out with a warning that names it; where it is the only one, the error does."""
    facts = {"width": 640, "height": 480, "depth_scale": case.frames.depth_scale, "cx": 320.0, "cy": 240.0}
    camera = Group({"t": case.frames.t, "pair": case.frames.pair}, {**facts, "fx": 607.7, "fy": 607.7})
    dark = {"color": np.zeros((480, 640, 3), np.uint8), "depth": np.zeros((480, 640), np.uint16)}
    black = {name: [cv2.imencode(".png", image)[1].tobytes()] * len(case.frames) for name, image in dark.items()}

    def pictures(run: str, name: str) -> Any:
        return black[name] if run == "away" else getattr(case.frames, name)

    def runs(*names: str) -> ArtifactData:
        made = {f"runs/{run}/{name}".rstrip("/"): group for run in names for name, group in case.streams.items()}
        return ArtifactData("recording", made | {f"runs/{run}/camera": camera for run in names})

    data, report = estimate(runs("away", "good"), case.robot, EstimateSettings(), pictures=pictures)
    assert data.runs() == ["good"]
    assert "run away of the recording is left out" in report.runs[0].warnings[0]
    with pytest.raises(InputError, match="run away"):
        estimate(runs("away"), case.robot, EstimateSettings(), pictures=pictures)
