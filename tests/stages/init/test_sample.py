"""The closed-form kinematic sample: rigid rods, exact velocities, honest labels, traps of real logs."""

from __future__ import annotations

import csv
import io
import tomllib

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.init.prism import PRISM_CABLES
from r2s2r_cli.stages.init.sample import NOISE_SD, kinematic_sample, sample_truth
from r2s2r_cli.stages.init.truth import WINCH_RATE, KinematicTruth

ROBOTS = ["threebar", "threebar-330"]


def smooth_times(truth: KinematicTruth) -> np.ndarray:
    """Times inside the run that are not within 1 ms of a kink of the motion."""
    t = np.linspace(0.01, truth.t_end - 0.01, 500)
    h = 1e-3
    low = [np.argmin(truth.caps(t + d)[..., 2], axis=1) for d in (-h, h)]
    same = (truth.edge_rates(t - h) == truth.edge_rates(t + h)).all(axis=1) & (low[0] == low[1])
    return t[same]


def table(text: str) -> dict[str, np.ndarray]:
    """The columns of the CSV."""
    rows = list(csv.DictReader(io.StringIO(text)))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.mark.parametrize("robot", ROBOTS)
def test_rods_are_rigid_and_the_lowest_cap_touches(robot: str) -> None:
    """Without noise, rods keep their length and the lowest cap lies at exactly one radius above the ground."""
    truth = sample_truth(robot)
    p_WE = truth.caps(np.linspace(0, truth.t_end, 300))
    np.testing.assert_allclose(np.linalg.norm(p_WE[:, 1::2] - p_WE[:, 0::2], axis=-1), truth.rod_length, atol=1e-14)
    np.testing.assert_allclose(p_WE[..., 2].min(axis=1), truth.cap_radius, atol=1e-14)


@pytest.mark.parametrize("robot", ROBOTS)
def test_velocity_is_the_derivative(robot: str) -> None:
    """The closed-form velocity equals the central difference of the position, and it is not small everywhere."""
    truth = sample_truth(robot)
    t, h = smooth_times(truth), 1e-6
    assert len(t) > 400
    v_WE = truth.velocities(t)
    np.testing.assert_allclose(v_WE, (truth.caps(t + h) - truth.caps(t - h)) / (2 * h), atol=1e-8)
    assert np.abs(v_WE).max() > 0.02


def test_motion_is_continuous() -> None:
    """No jump anywhere: over 1 ms no cap moves more than its largest speed allows."""
    truth = sample_truth()
    t = np.arange(0, truth.t_end, 1e-3)
    step = np.linalg.norm(np.diff(truth.caps(t), axis=0), axis=-1)
    assert step.max() <= 1.01e-3 * np.linalg.norm(truth.velocities(t), axis=-1).max()


def test_it_starts_at_rest_and_follows_its_targets() -> None:
    """The start is position 1 on the three rest caps; each interval ends at its target, reached at the winch rate."""
    truth = sample_truth()
    np.testing.assert_allclose(truth.edges(np.zeros(1)), 0.195, atol=1e-15)
    assert set(np.argsort(truth.caps(np.zeros(1))[0, :, 2])[:3]) == {0, 2, 5}
    ends = np.append(truth.start[1:], truth.t_end) - 1e-9
    reached = (truth.lengths(ends)[:, :6] - truth.min_length) / truth.range
    np.testing.assert_allclose(reached, truth.targets(ends), atol=1e-7)
    moving = np.unique(np.abs(truth.edge_rates(np.linspace(0, truth.t_end, 200))))
    assert moving.tolist() == [0.0, WINCH_RATE]


def test_control_sign() -> None:
    """+1 reels in: a cable with control +1 gets shorter, with -1 longer, with 0 stays."""
    truth = sample_truth()
    t = smooth_times(truth)
    change = truth.lengths(t + 1e-5)[:, :6] - truth.lengths(t - 1e-5)[:, :6]
    np.testing.assert_array_equal(np.sign(np.round(change, 9)), -truth.controls(t))


def test_same_seed_same_text() -> None:
    """The text depends on the seed and on nothing else."""
    assert kinematic_sample(3) == kinematic_sample(3)
    assert kinematic_sample(3)[0] != kinematic_sample(4)[0]


def test_csv_is_truth_plus_noise() -> None:
    """At the written stamps, caps are the truth plus white noise of the written size; columns are those of `import`."""
    text, sidecar = kinematic_sample(5)
    columns, truth = table(text), sample_truth()
    assert list(columns)[:4] == ["t_s", "cap0_x_m", "cap0_y_m", "cap0_z_m"]
    assert len(columns) == 1 + 18 + 6 + 6 + 9
    t = columns["t_s"]
    caps = np.stack([columns[f"cap{c}_{axis}_m"] for c in range(6) for axis in "xyz"], axis=1).reshape(-1, 6, 3)
    noise = caps - truth.caps(t)
    assert tomllib.loads(sidecar)["noise_sd_m"] == NOISE_SD
    assert noise.std() == pytest.approx(NOISE_SD, rel=0.1)
    assert abs(noise.mean()) < 1e-4
    lengths = np.stack([columns[f"length{i}_m"] for i in range(len(PRISM_CABLES))], axis=1)
    assert np.abs(lengths - truth.lengths(t)).max() < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_stamps_have_the_traps_of_real_logs(seed: int) -> None:
    """About 10 Hz with jitter; duplicates under 20 ms, honest gaps far above; at least six target intervals."""
    columns = table(kinematic_sample(seed)[0])
    gap = np.diff(columns["t_s"])
    duplicate = gap < 0.02
    assert gap.min() > 0
    assert 0.05 < duplicate.mean() < 0.35
    assert gap[~duplicate].min() > 0.025
    assert np.median(gap[~duplicate]) == pytest.approx(0.1, abs=0.015)
    assert gap[~duplicate].std() > 0.01
    targets = np.stack([columns[f"target{i}"] for i in range(6)], axis=1)
    assert 1 + int(np.any(np.diff(targets, axis=0) != 0, axis=1).sum()) >= 6


def test_it_says_what_it_is() -> None:
    """The sidecar carries the label, the robot and the controller's settings."""
    sidecar = tomllib.loads(kinematic_sample(1, robot="threebar-330")[1])
    assert sidecar["robot"] == "threebar-330"
    assert sidecar["nature"] == "kinematic sample"
    assert "closed-form kinematic sample, no physics" in sidecar["source"]
    assert sidecar["pid"]["min_length_m"] == 0.1


@pytest.mark.parametrize(
    ("robot", "intervals", "hint"),
    [
        ("sixbar", 8, "r2s2r init --robot threebar --sample"),
        ("nobody", 8, "--robot "),
        ("threebar", 0, "ask for 8"),
    ],
)
def test_wrong_requests_are_usage_errors(robot: str, intervals: int, hint: str) -> None:
    """Another robot, an unknown one, or no interval at all: a usage error (exit 2) with a hint."""
    with pytest.raises(UsageError) as caught:
        kinematic_sample(1, robot=robot, intervals=intervals)
    assert caught.value.exit_code == 2
    assert caught.value.hint.startswith(hint)
