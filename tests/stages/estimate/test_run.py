"""One run: where motors switch, what its groups hold, and what happens beside runs that cannot be estimated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.checks import CHECKS
from r2s2r_cli.checks.base import run_checks
from r2s2r_cli.checks.subjects import Content, runs_of
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.estimate.groups import run_groups
from r2s2r_cli.stages.estimate.noise import MIN_NOISE
from r2s2r_cli.stages.estimate.run import RunState, estimate_run, switches
from r2s2r_cli.stages.estimate.smooth import OUTLIER
from schemas.estimate import EstimateSettings
from tests.stages.estimate.builders import RUN, recording, replaced, threebar
from tests.stages.estimate.planted import planted

T = np.arange(10) * 0.1


@pytest.fixture(scope="module")
def state() -> RunState:
    """One planted run after the estimate."""
    return estimate_run("a", dict(recording(planted(106), run="a").streams("a")), threebar(), EstimateSettings())


def commands(**columns: list[float]) -> dict[str, Group]:
    """Commands of one cable at every frame."""
    return {"commands": Group({"t": T, **{name: np.array(values)[:, None] for name, values in columns.items()}})}


def test_a_change_of_target_counts_in_its_gap_and_the_next() -> None:
    """Control not logged: target changes between frames 3 and 4 and before the last one; the end has no next gap."""
    assert switches(commands(target=[0.0] * 4 + [1.0] * 5 + [0.0]), T).tolist() == [3, 4, 8]


def test_a_logged_control_says_when_motors_switch() -> None:
    """Gaps in which the sign of a control changes, and no others; the target does not count then."""
    control = [0.0, 0.0, 0.5, 0.7, 0.7, -0.2, -0.9, -0.9, 0.0, 0.0]
    assert switches(commands(target=[0.0] * 3 + [1.0] * 7, control=control), T).tolist() == [1, 4, 7]


def test_the_covariance_of_heights_holds_that_of_the_ground(state: RunState) -> None:
    """Caps known exactly on a ground known to 3 mm: variance 9e-6 m^2 in z, 0 elsewhere."""
    exact = replace(state.rods, cov_p=np.zeros_like(state.rods.cov_p))
    groups = run_groups(replace(state, rods=exact, ground=replace(state.ground, shift_sd=0.003)))
    expected = np.broadcast_to(np.diag([0.0, 0.0, 9e-6]), exact.cov_p.shape)
    assert groups["runs/a/frames"]["cov_p_WE"] == pytest.approx(expected, abs=1e-15)


def test_speed_change_is_that_over_one_second(state: RunState) -> None:
    """White acceleration of density 0.04 m^2/s^3 changes a velocity by 0.2 m/s over 1 s (standard deviation)."""
    groups = run_groups(replace(state, tracks=replace(state.tracks, density=np.full(6, 0.04))))
    assert groups["runs/a/tracks"]["speed_change"] == pytest.approx(0.2)


@pytest.mark.parametrize("moving", [True, False])
def test_an_exact_log_passes_the_checks_of_validate(moving: bool) -> None:
    """Noise-free caps, moving or at rest: the noise that is stored is the one that was used, and no check fails."""
    sample = planted(107)
    caps = sample.p_WE if moving else np.broadcast_to(sample.p_WE[0], sample.p_WE.shape).copy()
    path = "runs/planted/caps"
    data = replaced(recording(sample, caps=caps), path, noise_sd=np.zeros((6, 3)))
    made, report = estimate(data, threebar(), EstimateSettings())
    assert np.all(made.groups["runs/planted/tracks"]["noise_sd"] == MIN_NOISE)
    assert report.runs[0].caps[0].noise_sd_m == (MIN_NOISE, MIN_NOISE, MIN_NOISE)
    subjects = [Content(made), *runs_of(made, threebar())]
    found = [finding for subject in subjects for finding in run_checks(CHECKS, subject, "20-estimate.h5")]
    assert [finding for finding in found if finding.importance == "error"] == []


def test_a_run_without_end_caps_is_left_out_with_a_warning() -> None:
    """A camera run beside one with caps: that one is estimated as alone, and the report names what is missing."""
    data = recording(planted(103), run="b")
    camera = {"runs/a": Group({}, dict(RUN)), "runs/a/camera": Group({}, {"width": 640, "height": 480})}
    both, report = estimate(ArtifactData("recording", {**camera, **data.groups}), threebar(), EstimateSettings())
    alone, quiet = estimate(data, threebar(), EstimateSettings())
    assert both.runs() == [run.run for run in report.runs] == ["b"]
    assert np.array_equal(both.groups["runs/b/frames"]["p_WE"], alone.groups["runs/b/frames"]["p_WE"])
    assert report.runs[0].warnings[0].startswith("run a of the recording is left out")
    assert report.runs[0].warnings[1:] == quiet.runs[0].warnings


def test_two_runs_without_end_caps_are_refused() -> None:
    """Nothing is left to estimate: an input error that names a run and what it holds."""
    camera = {f"runs/{run}{name}": Group({}, dict(RUN)) for run in "ab" for name in ("", "/camera")}
    with pytest.raises(InputError, match="neither observed end caps nor") as caught:
        estimate(ArtifactData("recording", camera), threebar(), EstimateSettings())
    assert caught.value.received == "camera"


def test_a_cap_a_metre_off_in_one_frame_does_not_stop_the_estimate() -> None:
    """The frame is marked for that cap; the others, and the ground, stay as they were."""
    sample = planted(103)
    broken = sample.observed.copy()
    broken[60, 1] += [0.0, 0.0, 1.0]
    made, report = estimate(recording(sample, caps=broken), threebar(), EstimateSettings())
    clean, _ = estimate(recording(sample), threebar(), EstimateSettings())
    frames, before = (data.groups["runs/planted/frames"] for data in (made, clean))
    assert frames["quality"][60, 1] == OUTLIER
    assert np.sum(frames["quality"] != before["quality"]) == 1
    assert np.max(np.abs(frames["p_WE"] - before["p_WE"])) < 0.005
    assert report.runs[0].caps[1].outliers == 1
