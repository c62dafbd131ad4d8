"""The stage as a whole: recording in, estimate out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import ArtifactError, InputError, NumericalError, R2S2RError
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.estimate.rigid import rotate
from r2s2r_cli.stages.estimate.smooth import JUMP, OUTLIER, chi2_quantile
from r2s2r_cli.views.estimate_page import report_tables
from schemas.base import DIM_SIZES
from schemas.estimate import ESTIMATE, EstimateSettings
from schemas.results_estimate import EstimateReport
from tests.stages.estimate.builders import RUN, real_crawl, recording, replaced, threebar
from tests.stages.estimate.planted import JUDGING_SEEDS, LENGTH, N_INTERVALS, RADIUS, planted

DTYPES = {"bool": "bool", "uint8": "uint8", "int64": "int64", "int32": "int32", "float64": "float64"}


@pytest.fixture(scope="module")
def crawl(real_dir: Path) -> tuple[ArtifactData, EstimateReport]:
    """Estimate of the real crawl."""
    return estimate(real_crawl(real_dir), threebar(), EstimateSettings())


def check_layout(data: ArtifactData) -> None:
    """Every group and dataset is in the schema with its dtype and number of axes; equal axes have equal length."""
    for path, group in data.groups.items():
        spec = ESTIMATE.group(path)
        assert spec is not None, path
        assert {d.path for d in spec.datasets if d.required} <= set(group.datasets), path
        assert {a.name for a in spec.attributes if a.required} <= set(group.attributes), path
        assert set(group.attributes) <= {a.name for a in spec.attributes}, path
        sizes: dict[str, int] = dict(DIM_SIZES)
        for name in group.datasets:
            column = spec.dataset(name)
            assert column is not None, f"{path}/{name}"
            assert group[name].dtype == DTYPES[column.dtype], f"{path}/{name}"
            assert group[name].ndim == len(column.dims), f"{path}/{name}"
            for dim, size in zip(column.dims, group[name].shape, strict=True):
                assert sizes.setdefault(dim, size) == size, f"{path}/{name}: {dim}"
            if column.dtype == "float64" and not column.nan_means:
                assert np.all(np.isfinite(group[name])), f"{path}/{name}"


def test_planted_run_is_estimated_honestly() -> None:
    """On judging seeds: rods rigid, ground found, errors halved, 95 % ellipsoids hold 92 to 98 %, layout kept."""
    shares = []
    for seed in JUDGING_SEEDS[:5]:
        sample = planted(seed)
        data, report = estimate(recording(sample, shift_m=0.004), threebar(), EstimateSettings())
        check_layout(data)
        frames = data.groups["runs/planted/frames"]
        bar = frames["p_WE"][:, 1::2] - frames["p_WE"][:, 0::2]
        assert np.linalg.norm(bar, axis=-1) == pytest.approx(LENGTH, abs=1e-9)
        assert report.runs[0].ground.shift_m == pytest.approx(0.004, abs=1e-3)
        error = frames["p_WE"] - sample.p_WE
        assert np.sqrt(np.mean(error**2)) < 0.5 * np.sqrt(np.mean((sample.observed - sample.p_WE) ** 2))
        distance = np.einsum("tci,tcij,tcj->tc", error, np.linalg.inv(frames["cov_p_WE"]), error)
        shares.append(np.mean(distance < chi2_quantile(0.95)))
    assert 0.92 < np.mean(shares) < 0.98


def test_source_that_was_rigid_already_keeps_an_honest_covariance() -> None:
    """Noise that a tracker has fitted to rigid rods: recognised, and the ellipsoids still hold at least 92 %."""
    shares = []
    for seed in JUDGING_SEEDS[:4]:
        sample = planted(seed)
        bar = sample.observed[:, 1::2] - sample.observed[:, 0::2]
        middle = 0.5 * (sample.observed[:, 1::2] + sample.observed[:, 0::2])
        half = 0.5 * LENGTH * bar / np.linalg.norm(bar, axis=-1, keepdims=True)
        caps = np.stack([middle - half, middle + half], axis=2).reshape(sample.observed.shape)
        data, report = estimate(recording(sample, caps=caps), threebar(), EstimateSettings())
        assert report.runs[0].source_rigid
        frames = data.groups["runs/planted/frames"]
        error = frames["p_WE"] - sample.p_WE
        distance = np.einsum("tci,tcij,tcj->tc", error, np.linalg.inv(frames["cov_p_WE"]), error)
        shares.append(np.mean(distance < chi2_quantile(0.95)))
    assert 0.92 < np.mean(shares) < 0.99


def test_contacts_of_the_planted_runs_are_found() -> None:
    """Of the true contacts 97 % are found, of the claimed ones 93 % are true (caps that take off are seen late)."""
    found, true, claimed = 0, 0, 0
    for seed in JUDGING_SEEDS[:5]:
        sample = planted(seed)
        data, _ = estimate(recording(sample), threebar(), EstimateSettings())
        contact = data.groups["runs/planted/frames"]["contact"]
        found += int(np.sum(contact & sample.contact))
        true += int(np.sum(sample.contact))
        claimed += int(np.sum(contact))
    assert found > 0.97 * true
    assert found > 0.93 * claimed


def test_poses_velocities_and_lengths_agree_with_the_caps() -> None:
    """Caps follow from p_WR and q_WR; their velocities from v_WR and w_WR; lengths are distances of caps."""
    data, _ = estimate(recording(planted(100)), threebar(), EstimateSettings())
    frames = data.groups["runs/planted/frames"]
    z = rotate(frames["q_WR"], np.broadcast_to([0.0, 0.0, 1.0], frames["p_WR"].shape))
    for side, first in ((-0.5, 0), (0.5, 1)):
        assert frames["p_WR"] + side * LENGTH * z == pytest.approx(frames["p_WE"][:, first::2], abs=1e-9)
        v = frames["v_WR"] + np.cross(frames["w_WR"], side * LENGTH * z)
        assert v == pytest.approx(frames["v_WE"][:, first::2], abs=1e-9)
    a, b = threebar().cables[7].caps
    assert frames["length"][:, 7] == pytest.approx(np.linalg.norm(frames["p_WE"][:, a] - frames["p_WE"][:, b], axis=-1))


def test_dropped_frames_are_left_out_and_the_rest_is_carried() -> None:
    """Frames are the kept ones, with their row; commands come along, intervals are found where there are none."""
    sample = planted(101)
    data = recording(sample)
    caps = data.groups["runs/planted/caps"]
    drop = np.zeros(len(sample.t), dtype=np.uint8)
    drop[[3, 40]] = 1
    broken = caps["p_WE"].copy()
    broken[[3, 40]] = np.nan
    without = {k: g for k, g in data.groups.items() if not k.endswith(("intervals", "segments"))}
    made, report = estimate(
        replaced(ArtifactData("recording", without), "runs/planted/caps", drop_reason=drop, p_WE=broken),
        threebar(),
        EstimateSettings(),
    )
    check_layout(made)
    frames = made.groups["runs/planted/frames"]
    assert np.array_equal(frames["source_frame"], np.flatnonzero(drop == 0))
    assert np.array_equal(frames["t"], sample.t[drop == 0])
    assert made.groups["runs/planted/commands"] is data.groups["runs/planted/commands"]
    assert len(made.groups["runs/planted/intervals"]["first"]) == N_INTERVALS == report.runs[0].intervals
    assert made.groups["runs/planted/intervals"]["last"][-1] == len(frames["t"]) - 1


def test_intervals_of_the_recording_are_taken_as_they_are() -> None:
    """What `import` found is not found again."""
    data = recording(planted(102))
    made, _ = estimate(data, threebar(), EstimateSettings())
    for name in ("intervals", "segments"):
        for column, values in data.groups[f"runs/planted/{name}"].datasets.items():
            assert np.array_equal(made.groups[f"runs/planted/{name}"][column], values)  # type: ignore[arg-type]


def test_several_runs_are_independent() -> None:
    """Two runs in one recording give what each gives alone."""
    a, b = recording(planted(103), run="a"), recording(planted(104), run="b")
    both, report = estimate(ArtifactData("recording", {**a.groups, **b.groups}), threebar(), EstimateSettings())
    alone, _ = estimate(b, threebar(), EstimateSettings())
    assert [run.run for run in report.runs] == both.runs() == ["a", "b"]
    assert np.array_equal(both.groups["runs/b/frames"]["p_WE"], alone.groups["runs/b/frames"]["p_WE"])


def test_settings_reach_the_result() -> None:
    """A wider clearance finds no fewer contacts, a laxer gate fewer broken frames."""
    sample = planted(105)
    caps = sample.observed.copy()
    caps[50, 0] += [0.02, 0.0, 0.0]
    data = recording(sample, caps=caps)
    strict, _ = estimate(data, threebar(), EstimateSettings())
    lax, _ = estimate(data, threebar(), EstimateSettings(contact_clearance_m=0.02, gate_probability=1e-30))
    path = "runs/planted/frames"
    assert np.sum(lax.groups[path]["contact"]) > np.sum(strict.groups[path]["contact"])
    assert strict.groups[path]["quality"][50, 0] == OUTLIER
    assert np.all(lax.groups[path]["quality"] == 0)


def broken_inputs() -> dict[str, tuple[ArtifactData, type[R2S2RError], str]]:
    """Recordings that cannot be estimated: what is wrong, the error, a word of the message."""
    sample = planted(0)
    data = recording(sample)
    caps = data.groups["runs/planted/caps"]
    n = len(sample.t)
    holes = caps["p_WE"].copy()
    holes[5, 2, 1] = np.nan
    together = caps["p_WE"].copy()
    together[:, 1] = together[:, 0] + [0.0, 0.0, LENGTH]
    together[6:9, 1] = together[6:9, 0]
    camera = {"runs/x": Group({}, dict(RUN)), "runs/x/camera": Group({}, {"width": 640, "height": 480})}
    path = "runs/planted/caps"
    return {
        "no caps": (ArtifactData("recording", camera), InputError, "camera"),
        "no run": (ArtifactData("recording", {}), ArtifactError, "no run"),
        "other kind": (ArtifactData("policy", data.groups), ArtifactError, "recording"),
        "four frames": (
            replaced(data, path, drop_reason=np.array([0] * 4 + [1] * (n - 4), dtype=np.uint8)), InputError, "too few"),
        "all dropped": (replaced(data, path, drop_reason=np.full(n, 1, dtype=np.uint8)), InputError, "too few"),
        "not finite": (replaced(data, path, p_WE=holes), InputError, "finite"),
        "stamps": (replaced(data, path, t=sample.t[::-1].copy()), InputError, "increase"),
        "other rods": (replaced(data, path, p_WE=1.2 * caps["p_WE"]), InputError, "length"),
        "other caps": (replaced(data, path, p_WE=caps["p_WE"][:, :4]), InputError, "number of end caps"),
        "intervals": (
            replaced(data, "runs/planted/intervals", last=data.groups["runs/planted/intervals"]["last"] + n),
            InputError, "intervals"),
        "noise": (replaced(data, path, noise_sd=np.full((6, 3), np.nan)), NumericalError, "noise"),
    }  # fmt: skip


@pytest.mark.parametrize("name", sorted(broken_inputs()))
def test_bad_input_is_refused_with_a_hint(name: str) -> None:
    """A recording that allows no estimate: what is wrong, where, what was expected and received, what to do."""
    data, kind, word = broken_inputs()[name]
    with pytest.raises(kind) as caught:
        estimate(data, threebar(), EstimateSettings())
    assert word in str(caught.value)
    assert caught.value.where and caught.value.hint and caught.value.expected and caught.value.received


def test_real_crawl_ground_noise_and_rods(crawl: tuple[ArtifactData, EstimateReport]) -> None:
    """The real crawl: 131 of 202 frames, 11 intervals, noise of 0.5 to 4 mm, ground 4 mm low, rods rigid already."""
    data, report = crawl
    check_layout(data)
    run = report.runs[0]
    assert (run.frames, run.rows, run.intervals) == (131, 202, 11)
    assert 0.003 < run.ground.shift_m < 0.0045
    assert run.ground.shift_sd_m < 0.0005
    assert run.ground.offset_recording_m == pytest.approx(0.004, abs=0.0005)
    assert run.source_rigid
    noise = np.array([cap.noise_sd_m for cap in run.caps])
    assert 0.0005 < noise.min() < noise.max() < 0.004
    assert [cap.cap for cap in run.caps if any(cap.held)] == [5]
    table = next(one for one in report_tables(report) if "end caps" in one.title)
    assert [row[0] for row in table.rows if "*" in row[1]] == ["5"] and "; * the source held this axis" in table.title


def test_real_crawl_marks_the_jumps_of_its_tracker(crawl: tuple[ArtifactData, EstimateReport]) -> None:
    """The tracker jumps between 3.0 and 3.3 s, all caps at once; that is marked, and smoothed speeds stay possible."""
    frames = crawl[0].groups["runs/crawl/frames"]
    t, quality = frames["t"], frames["quality"]
    jumping = np.any(((quality == JUMP) | (quality == OUTLIER))[(t > 3.0) & (t < 3.5)], axis=0)
    assert np.sum(jumping) >= 4
    assert {3, 4, 5} <= {broken.interval for broken in crawl[1].runs[0].broken}
    # Cables move at most 65 mm/s; a cap on a tipping rod moves a few times faster. Raw differences reach 590 mm/s.
    assert np.max(np.linalg.norm(frames["v_WE"], axis=-1)) < 0.25


def test_real_crawl_lengths_follow_their_targets(crawl: tuple[ArtifactData, EstimateReport]) -> None:
    """At the end of an interval, three of four cables are within twice the tolerance (20 mm) of their target."""
    data, _ = crawl
    frames, intervals = data.groups["runs/crawl/frames"], data.groups["runs/crawl/intervals"]
    attributes = data.groups["runs/crawl"].attributes
    wanted = float(attributes["pid_min_length"]) + float(attributes["pid_range"]) * intervals["target"]
    ends = frames["length"][intervals["last"][:-1], :6]
    assert np.median(np.abs(ends - wanted[:-1])) < 0.010
    assert np.mean(np.abs(ends - wanted[:-1]) < 0.020) > 0.75


def test_real_crawl_contacts_are_plausible(crawl: tuple[ArtifactData, EstimateReport]) -> None:
    """Caps 0, 3 and 5 carry the robot most of the time; caps 1 and 4, 80 mm up, never do; heights are worth 5 mm."""
    report = crawl[1].runs[0]
    share = [cap.contact_share for cap in report.caps]
    assert min(share[0], share[3], share[5]) > 0.5
    assert share[1] == share[4] == 0.0
    assert report.ground.height_error_m == pytest.approx(0.005, abs=0.002)
    assert all(cap.height_min_m > RADIUS - 0.005 for cap in report.caps)
