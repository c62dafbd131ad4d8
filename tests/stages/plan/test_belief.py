"""What the planner believes: values and spread of an identification, priors where nothing was identified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.plan.belief import assumed, identified
from tests.support.builders import identification, robot


def test_an_identification_is_believed() -> None:
    """Best values first; draws of log coordinates have its covariance, numbers that the runs do not say their prior's
    width, and all lie within their bounds."""
    belief = identified(robot(), identification(), "30-identify.h5")
    names = list(belief.model.mapping.names)
    assert names == ["motor_speed", "friction", "damping", "restitution"] and belief.identified
    draws = belief.draws(4000, np.random.default_rng(0))
    assert np.allclose(draws[0], [0.8, 0.62, 4.0, 0.3])
    z = np.log(draws[1:, :2])
    assert np.allclose(z.std(axis=0), [0.0125, 0.08], rtol=0.05)
    assert abs(np.corrcoef(z.T)[0, 1] + 0.4) < 0.05
    # The last is not identifiable, and its prior is flat: it stays where it is.
    assert np.allclose(draws[:, 3], 0.3, rtol=1e-12)
    assert (draws[:, 2] < 50.0).all() and belief.words == "30-identify.h5"


def test_a_simulator_errs_by_more_than_noise_leaves_open() -> None:
    """With doubt no number varies less than that share of its prior; what was known less well stays as it was."""
    known = identified(robot(), identification(), "30-identify.h5")
    doubted = replace(known, doubt=0.2).draws(4000, np.random.default_rng(0))
    speed, friction = known.model.mapping.frees[0], known.model.mapping.frees[1]
    spread = np.log(doubted[1:, :2]).std(axis=0)
    assert np.allclose(spread, [max(0.0125, 0.2 * speed.prior_sd), max(0.08, 0.2 * friction.prior_sd)], rtol=0.05)
    assert spread[0] > 2 * 0.0125 and np.allclose(doubted[0], known.draws(1, np.random.default_rng(0))[0])


def test_without_one_the_priors_count() -> None:
    """robot.toml's values, and the relative width of their priors."""
    belief = assumed(robot())
    draws = belief.draws(4000, np.random.default_rng(1))
    names = list(belief.model.mapping.names)
    friction = draws[1:, names.index("friction")]
    assert not belief.identified and np.isclose(draws[0, names.index("friction")], robot().contact.friction)
    assert abs(np.log(friction).std() - 0.5) < 0.05


def test_those_of_another_robot_are_refused() -> None:
    """By its name, and by parameters that this robot does not have."""
    data = identification()
    facts = data.groups["fit"]
    other = Group(facts.datasets, {**facts.attributes, "robot": "sixbar"})
    with pytest.raises(InputError, match="another robot"):
        identified(robot(), ArtifactData(data.kind, {**data.groups, "fit": other}), "30-identify.h5")
    table = data.groups["parameters"]
    names = np.array([b"motor_speed", b"friction", b"wings", b"restitution"])
    odd = Group({**table.datasets, "name": names}, table.attributes)
    with pytest.raises(InputError, match="does not have"):
        identified(robot(), ArtifactData(data.kind, {**data.groups, "parameters": odd}), "30-identify.h5")
