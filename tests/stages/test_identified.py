"""The simulator as an identification left it: the same numbers, the same doubts, no other robot's."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.engine.flat import pack_parameters
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identified import identified, nominal
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.model import parameters_of
from tests.support import builders

NAMES = ("friction", "rest_length.6", "restitution", "mass.1", "command_delay")
VALUE = (0.6, 0.17, 0.1, 0.12, 0.05)
SD_Z = (0.1, 0.02, math.nan, math.nan, math.nan)


def found(robot: str = "threebar", names: tuple[str, ...] = NAMES) -> ArtifactData:
    """Two numbers identified and correlated, one not identifiable without and one with a prior, the last by hand."""
    own = entries(builders.robot())
    table = [own[name].free for name in NAMES]
    covariance = np.diag(np.square(SD_Z))
    covariance[0, 1] = covariance[1, 0] = 0.5 * SD_Z[0] * SD_Z[1]
    parameters = {
        "name": np.array([name.encode() for name in names], dtype=object),
        "value": np.array(VALUE),
        "bounds": np.array([(free.lower, free.upper) for free in table]),
        "start": np.array([free.start for free in table]),
        "prior_mean": np.array([math.nan, math.nan, math.nan, 0.1334, math.nan]),
        "prior_sd": np.array([math.nan, math.nan, math.nan, 0.15, math.nan]),
        "coordinate": np.array([["linear", "log", "logit"].index(free.coordinate.value) for free in table], np.uint8),
        "identifiable": np.array([True, True, False, False, False]),
        "trust": np.array([0, 0, 2, 2, 4], np.uint8),
    }
    fit = Group(attributes={"robot": robot, "effects": ""})
    return ArtifactData("identification", {
        "fit": fit, "parameters": Group(parameters), "covariance": Group({"covariance": covariance}),
    })  # fmt: skip


def test_its_numbers_are_those_of_the_artifact() -> None:
    """What the engine gets is what was found and what was fixed by hand; the delay lies before the winches."""
    model = identified(found(), builders.robot())
    theta = model.theta
    assert theta.friction.unique().tolist() == [0.6]
    assert theta.rest[0, 0].item() == pytest.approx(0.17)
    assert theta.mass[0, 1].item() == pytest.approx(0.12)
    assert model.late == 0.05
    assert model.link is not None
    assert model.link.delay == 0.05


def test_the_nominal_simulator_is_that_of_robot_toml() -> None:
    """Bit by bit, with no doubt in it."""
    robot = builders.robot()
    model = nominal(robot)
    assert torch.equal(
        pack_parameters(model.structure, model.theta), pack_parameters(model.structure, parameters_of(robot))
    )
    assert model.link is None
    assert model.draws(3, 0).shape == (3, 0)


def test_draws_have_the_covariance_of_the_coordinates() -> None:
    """Mean, standard deviation and correlation in z, within four standard errors; the first is the estimate."""
    model = identified(found(), builders.robot())
    count = 4000
    draws = model.draws(count, 7)
    z = np.array([[f.to_z(x) for f, x in zip(model.mapping.frees, row, strict=True)] for row in draws[1:, :]])
    assert draws[0] == pytest.approx(VALUE[:4])
    centre = np.array([f.to_z(x) for f, x in zip(model.mapping.frees, VALUE[:4], strict=True)])
    sd = np.array([SD_Z[0], SD_Z[1]])
    assert np.abs(z[:, :2].mean(axis=0) - centre[:2]).max() < 4 * (sd / np.sqrt(count)).max()
    assert z[:, :2].std(axis=0) == pytest.approx(sd, rel=4 / np.sqrt(2 * count))
    assert np.corrcoef(z[:, :2].T)[0, 1] == pytest.approx(0.5, abs=4 / np.sqrt(count))


def test_what_the_runs_did_not_say_comes_from_its_prior_or_stays() -> None:
    """Restitution has no prior and stays; the mass has one, which is not about the value that was found."""
    draws = identified(found(), builders.robot()).draws(4000, 1)
    assert np.ptp(draws[:, 2]) < 1e-15
    z = np.log(draws[1:, 3])
    assert z.mean() == pytest.approx(math.log(0.1334), abs=4 * 0.15 / np.sqrt(4000))
    assert z.std() == pytest.approx(0.15, rel=4 / np.sqrt(8000))


def test_draws_stay_within_the_bounds() -> None:
    """However wide the covariance is."""
    wide = found()
    wide.groups["covariance"]["covariance"][0, 0] = 100.0
    model = identified(wide, builders.robot())
    draws, free = model.draws(200, 0)[:, 0], model.mapping.frees[0]
    assert np.all((draws > free.lower) & (draws < free.upper))


@pytest.mark.parametrize(
    ("artifact", "what"),
    [(found(robot="sixbar"), "another robot"), (found(names=("friction", "stiffness.30", *NAMES[2:])), "stiffness.30")],
)
def test_another_robots_numbers_are_refused(artifact: ArtifactData, what: str) -> None:
    """By name, with what to do."""
    with pytest.raises(InputError, match=what) as refused:
        identified(artifact, builders.robot())
    assert refused.value.hint


def test_its_controller_reads_what_the_robots_reads() -> None:
    """With measured sensors a cable counts as arrived where the reading does, and commands are as late as measured."""
    plain = identified(found(), builders.robot())
    bias = np.array([0.003, -0.005, 0.0, 0.001, 0.0, -0.002])
    loop = Group({"bias": bias}, {"camera_delay": 0.02, "command_delay": 0.03, "arrivals": 20})
    model = identified(ArtifactData("identification", {**found().groups, "sensing": loop}), builders.robot())
    length = torch.full((1, 9), 0.15, dtype=torch.float64)
    true, read = length.clone(), length.clone()
    true[0, list(builders.robot().actuated)] -= torch.as_tensor(bias)
    assert torch.allclose(model.pid.position(true), plain.pid.position(read), rtol=0, atol=1e-15)
    assert model.link is not None
    assert model.link.delay == 0.03
    assert model.late == 0.05, "command replay is as late as ever"
