"""Runs as a fit gets them: kept frames on the ground, and an exit code for everything nothing can be learned from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import ExitCode, InputError
from r2s2r_cli.stages.identify.load import AVERAGED_S, STILL, require_two_intervals, run_data
from tests.stages.measures.gait import FRAMES, path, run

SHIFT = 0.004
NOISE = 0.001


def artifacts(intervals: int = 6, *, p_WE: np.ndarray | None = None) -> tuple[ArtifactData, ArtifactData]:
    """Recording and estimate of the gait: every third row of the recording was dropped, its ground lies 4 mm low.

    The smoothed end caps are 0.1 mm beside the observed ones, the same everywhere.
    """
    walk = run(intervals, observed=p_WE, noise=NOISE)
    n = len(walk.t)
    rows = np.flatnonzero(np.arange(n + n // 2) % 3 != 2)[:n]
    t, caps = np.full(rows[-1] + 1, np.nan), np.full((rows[-1] + 1, 6, 3), np.nan)
    t[rows], caps[rows] = walk.t, walk.observed - np.array([0.0, 0.0, SHIFT])
    recording = {"runs/walk": Group(), "runs/walk/caps": Group({"t": t, "p_WE": caps})}
    estimate = {
        "runs/walk": Group(),
        "runs/walk/frames": Group({
            "t": walk.t, "source_frame": rows, "p_WE": walk.p_WE + 1e-4, "v_WE": walk.v_WE, "sd_v_WE": walk.sd_v,
            "cov_p_WE": np.tile(np.diag([4e-6, 9e-6, 1e-6]), (n, 6, 1, 1)), "quality": walk.quality,
        }),
        "runs/walk/tracks": Group({"noise_sd": walk.noise}),
        "runs/walk/ground": Group({}, {"shift": SHIFT}),
        "runs/walk/commands": Group({"t": walk.t_command, "target": walk.target, "control": walk.control + 0.5}),
        "runs/walk/intervals": walk.intervals.to_group(),
        "runs/walk/segments": walk.segments.to_group(),
    }  # fmt: skip
    return ArtifactData("recording", recording), ArtifactData("estimate", estimate)


def changed(data: ArtifactData, stream: str, **datasets: Any) -> ArtifactData:
    """One group with other datasets; None takes one away."""
    group = data.groups[f"runs/walk/{stream}"]
    kept = {name: value for name, value in {**group.datasets, **datasets}.items() if value is not None}
    return ArtifactData(data.kind, {**data.groups, f"runs/walk/{stream}": Group(kept, group.attributes)})


def without(data: ArtifactData, stream: str) -> ArtifactData:
    """One group less."""
    return ArtifactData(data.kind, {name: one for name, one in data.groups.items() if name != f"runs/walk/{stream}"})


def test_what_a_recording_is_goes_with_it() -> None:
    """A simulation is called one on every page; a recording that does not say has no name for it."""
    recording, estimate = artifacts()
    assert run_data(recording, estimate, "walk").nature == ""
    groups = {**estimate.groups, "runs/walk": Group({}, {"nature": "simulated"})}
    assert run_data(recording, ArtifactData("estimate", groups), "walk").nature == "simulated"


def test_observed_caps_are_those_of_the_kept_frames_on_the_ground() -> None:
    """Rows that were dropped leave no trace, and the shift of the ground is applied once."""
    recording, estimate = artifacts()
    found = run_data(recording, estimate, "walk", name="002-walk")
    assert found.name == "002-walk"
    assert found.observed == pytest.approx(path(6), abs=1e-15)
    assert found.p_WE == pytest.approx(path(6) + 1e-4, abs=1e-15)
    assert found.sd_p[3, 2] == pytest.approx([2e-3, 3e-3, 1e-3])
    assert found.noise == pytest.approx(np.full((6, 3), NOISE))
    assert found.intervals.last.tolist() == [FRAMES * (i + 1) - 1 for i in range(6)]
    assert found.sampled


def test_without_caps_in_the_recording_the_smoothed_ones_are_observed() -> None:
    """A tracker made them on the way; with the commands of the controller, which are not sampled by frames."""
    recording, estimate = artifacts()
    for source in (None, without(recording, "caps")):
        found = run_data(source, estimate, "walk")
        assert found.observed == pytest.approx(path(6) + 1e-4, abs=1e-15)
        assert not found.sampled


def test_commands_between_frames_are_not_sampled() -> None:
    """One command row at a stamp that no frame has: the rows are commands as they were sent."""
    recording, estimate = artifacts()
    t = run(6).t_command.copy()
    t[4] += 0.03
    assert not run_data(recording, changed(estimate, "commands", t=t), "walk").sampled


def test_controls_that_are_not_logged_count_as_off() -> None:
    """NaN in some rows is 0; the others stay."""
    recording, estimate = artifacts()
    control = np.full((36, 2), 0.5)
    control[3] = np.nan
    found = run_data(recording, changed(estimate, "commands", control=control), "walk")
    assert found.control[2:5].tolist() == [[0.5, 0.5], [0.0, 0.0], [0.5, 0.5]]


NO_FRAMES = {
    name: np.zeros((0, *shape)) for name, shape in {"t": (), "p_WE": (6, 3), "v_WE": (6, 3), "sd_v_WE": (6, 3)}.items()
}
NO_INTERVALS = {name: value[:0] for name, value in run(6).intervals.to_group().datasets.items()}  # type: ignore[index]
HOLE = np.where(np.arange(36)[:, None, None] == 20, np.nan, path(6))

BAD: dict[str, tuple[Callable[[ArtifactData], ArtifactData], str]] = {
    "no control column": (lambda e: changed(e, "commands", control=None), "no motor commands"),
    "no motor commanded": (lambda e: changed(e, "commands", control=np.zeros((36, 2))), "no motor is commanded"),
    "control never logged": (lambda e: changed(e, "commands", control=np.full((36, 2), np.nan)), "no motor commands"),
    "no commands": (lambda e: without(e, "commands"), "no commands"),
    "no frames": (lambda e: changed(e, "frames", source_frame=np.zeros(0, int), **NO_FRAMES), "no frame left"),
    "no group of intervals": (lambda e: without(e, "intervals"), "no intervals"),
    "no intervals": (lambda e: changed(e, "intervals", **NO_INTERVALS), "no target intervals"),
    "NaN in the smoothed caps": (lambda e: changed(e, "frames", p_WE=HOLE), "not finite"),
    "NaN in the noise": (lambda e: changed(e, "tracks", noise_sd=np.full((6, 3), np.nan)), "not finite"),
    "NaN in the stamps": (lambda e: changed(e, "commands", t=np.full(36, np.nan)), "not finite"),
    "rows beyond the recording": (lambda e: changed(e, "frames", source_frame=np.arange(36) + 30), "another recording"),
    "stamps of another recording": (lambda e: changed(e, "frames", t=run(6).t + 1.0), "another recording"),
    "intervals beyond the frames": (lambda e: changed(e, "intervals", last=np.arange(6) * 6 + 6), "more frames"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_learned_from_is_bad_input(case: str) -> None:
    """Exit code 4, in words, with a hint."""
    recording, estimate = artifacts()
    damage, words = BAD[case]
    with pytest.raises(InputError, match=words) as error:
        run_data(recording, damage(estimate), "walk")
    assert error.value.exit_code == ExitCode.INPUT
    assert error.value.hint


def test_nan_in_a_kept_frame_of_the_recording_is_bad_input() -> None:
    """One coordinate of the observed caps: place and number are told."""
    recording, estimate = artifacts()
    caps = recording.groups["runs/walk/caps"]["p_WE"].copy()
    caps[3, 2, 1] = np.nan
    with pytest.raises(InputError, match="not finite") as error:
        run_data(changed(recording, "caps", p_WE=caps), estimate, "walk")
    assert error.value.where == "runs/walk: observed[2, 2, 1]"
    assert error.value.received == "1 that are not"


@pytest.mark.parametrize(("factor", "still"), [(0.99, True), (1.01, False)])
def test_a_run_that_moves_less_than_its_noise_is_bad_input(factor: float, still: bool) -> None:
    """One cap moves for good by just under, or just over, three times what noise makes of the mean of all its axes over
    half a second."""
    p_WE = np.tile(path(1)[:1], (36, 1, 1))
    clock = run(6).t
    averaged = np.count_nonzero(clock < clock[0] + AVERAGED_S)
    assert averaged > 1
    p_WE[averaged:, 4, 0] += factor * STILL * NOISE * (3 / averaged) ** 0.5
    recording, estimate = artifacts(p_WE=p_WE)
    if not still:
        assert run_data(recording, estimate, "walk").name == "walk"
        return
    with pytest.raises(InputError, match="nothing moves") as error:
        run_data(recording, estimate, "walk")
    assert "cap 4" in error.value.received
    assert run_data(recording, estimate, "walk", still=True).name == "walk"


def test_a_log_without_noise_that_does_not_move_is_bad_input() -> None:
    """No noise at all: still is still, and nothing is divided by 0."""
    recording, estimate = artifacts(p_WE=np.tile(path(1)[:1], (36, 1, 1)))
    exact = changed(estimate, "tracks", noise_sd=np.zeros((6, 3)))
    with pytest.raises(InputError, match="nothing moves") as error:
        run_data(recording, exact, "walk")
    assert "at most 0.0 mm" in error.value.received


def test_one_interval_alone_is_bad_input_and_two_of_any_runs_are_not() -> None:
    """One complete interval in all runs: exit 4; constant targets are called by their name."""
    one, many = run(1), run(3)
    with pytest.raises(InputError, match="targets never change") as error:
        require_two_intervals([one])
    assert error.value.exit_code == ExitCode.INPUT
    incomplete = run(2)
    incomplete.intervals.complete[1] = False
    with pytest.raises(InputError, match="one target interval is not enough"):
        require_two_intervals([incomplete])
    with pytest.raises(InputError):
        require_two_intervals([])
    require_two_intervals([one, many])
    require_two_intervals([one, run(1)])


def test_of_camera_images_what_was_known_at_each_frame_is_observed() -> None:
    """A recording without end caps: the smoothed ones know later frames and would tell test segments their future."""
    recording, estimate = artifacts()
    known = run_data(recording, estimate, "walk").observed + 3e-4
    filtered = changed(estimate, "tracks", observed=known)
    assert run_data(without(recording, "caps"), filtered, "walk").observed == pytest.approx(known)


def test_guesses_of_hidden_caps_count_as_faults() -> None:
    """Of camera images: a cap that was hidden until it was 5 mm uncertain, and frames before the tracker began; a cap
    that is seen is none, however noisy the camera, nor is one that was hidden for a moment."""
    recording, estimate = artifacts()
    frames = estimate.group("walk", "frames")
    assert frames is not None
    quality, sd = np.zeros_like(frames["quality"]), np.full((*frames["quality"].shape, 3), 0.001)
    quality[10:30, 2], sd[15:30, 2, 1] = 1, 0.006
    sd[40:, 4] = 0.009
    known = changed(changed(estimate, "tracks", observed=frames["p_WE"], observed_sd=sd), "frames", quality=quality)
    camera = ArtifactData(known.kind, {**known.groups, "runs/walk/camera": Group({}, {"begun": 3})})
    found = run_data(without(recording, "caps"), camera, "walk").quality
    fault = found == 2
    assert fault[:3].all() and not fault[3:, [0, 1, 3, 4, 5]].any()
    assert np.flatnonzero(fault[3:, 2]).tolist() == list(range(12, 27))
    assert (found[10:15, 2] == 1).all()
    assert run_data(recording, known, "walk").quality == pytest.approx(quality)
    known_to = run_data(without(recording, "caps"), camera, "walk").sd_at(np.array([5, 20]))
    noise = run_data(recording, known, "walk").noise
    assert known_to[0] == pytest.approx(np.maximum(noise, 0.001)) and known_to[1, 2, 1] == max(noise[2, 1], 0.006)
    assert run_data(recording, known, "walk").observed_sd is None  # these caps were logged, not seen
