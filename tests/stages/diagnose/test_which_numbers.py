"""The model of a diagnosis: off is nominal to the last bit, factors are factors, every effect has candidates."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import CATALOGUE
from r2s2r_cli.engine.flat import pack_parameters
from r2s2r_cli.stages.diagnose.parity.expected import EXPECTED
from r2s2r_cli.stages.diagnose.parity.suspects import suspicions
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import nominal
from schemas.results_diagnose import NO_REPLAY
from tests.support.builders import robot


@pytest.fixture(scope="module")
def model() -> Model:
    """Of the example robot, the whole catalogue at hand."""
    return Model(nominal(robot()))


def test_off_values_are_the_nominal_simulator(model: Model) -> None:
    """With nothing changed the parameters are those of robot.toml, bit by bit."""
    base = nominal(robot()).theta
    theta = model.theta(model.values0)
    assert torch.equal(theta.friction, base.friction) and torch.equal(theta.speed_in, base.speed_in)
    assert torch.equal(theta.stiffness, base.stiffness) and torch.equal(theta.restitution, base.restitution)


def test_a_factor_multiplies_and_a_batch_is_its_rows(model: Model) -> None:
    """exp(x) times the nominal number; several hypotheses at once are the same as one by one."""
    two = np.repeat(model.values0[None], 2, axis=0)
    two[1, model.place["friction"]] = np.log(1.5)
    both = model.theta(two)
    assert both.friction[1] == pytest.approx((1.5 * both.friction[0]).numpy())
    alone = pack_parameters(model.structure, model.theta(two[1]))
    assert torch.equal(pack_parameters(model.structure, both)[1], alone[0])


def test_every_effect_but_those_of_parity_can_be_a_hypothesis(model: Model) -> None:
    """Each has tries within its bounds, none of which is off."""
    made = candidates(model)
    assert {one.effect for one in made} == {effect.name for effect in CATALOGUE} - set(NO_REPLAY)
    for one in made:
        assert len(one.tries), one.label
        assert np.all(one.tries >= one.lower) and np.all(one.tries <= one.upper), one.label
        assert np.all(np.any(one.tries != one.off, axis=1)), one.label


def test_what_parity_suspects_is_tried_first(model: Model) -> None:
    """A size by element goes to that element alone."""
    made = candidates(model, {"motor_speed_mismatch": {"factor.2": 0.83}})
    by_motor = {one.element.index: one for one in made if one.effect == "motor_speed_mismatch" and one.element}
    assert by_motor[2].tries[0] == pytest.approx([0.83])
    assert by_motor[1].tries[0] != pytest.approx([0.83])


def test_a_patch_is_tried_where_caps_stood(model: Model) -> None:
    """The centre of a patch starts at the places that were touched, and nowhere else."""
    touched = np.array([[0.1, 0.2], [-0.3, 0.4]])
    patch = next(one for one in candidates(model, None, touched) if any("patch_x_m" in name for name in one.names))
    centres = {tuple(row) for row in patch.tries[:, 1:3].round(6).tolist()}
    assert centres == {(0.1, 0.2), (-0.3, 0.4)}


def test_what_is_looked_for_where_it_is_named_is_a_hypothesis_there_only(model: Model) -> None:
    """Beside the whole catalogue, and with lines of a ridge through the places that were touched, three directions
    each, at its own height; ends of a sensor's range are two laws, tried with their shares."""
    assert "obstacle" not in {one.effect for one in candidates(model)}
    asked = Model(nominal(robot()), asked=("obstacle", "sensor_saturation"))
    touched = np.array([[0.1, 0.2], [-0.3, 0.4]])
    made = candidates(asked, None, touched)
    assert {one.effect for one in made} - {one.effect for one in candidates(model)} == {"obstacle", "sensor_saturation"}
    ridge = next(one for one in made if one.effect == "obstacle")
    height, distance, angle, _ = ridge.tries.T
    away = touched[:, 0] * np.cos(angle[:, None]) + touched[:, 1] * np.sin(angle[:, None]) - distance[:, None]
    assert len(ridge.tries) == 6 and np.all(height == 0.004) and np.all(np.abs(away).min(axis=1) < 1e-12)
    assert ridge.shape.tolist() == [False, True, True, True]
    ends = {tuple(name.split(".")[1] for name in one.names) for one in made if one.effect == "sensor_saturation"}
    assert ends == {("top_share", "top_m"), ("bottom_share", "bottom_m")}


def test_a_share_of_a_size_stays_where_it_is(model: Model) -> None:
    """Half a patch has half the factor's distance from off, in the same place and as wide."""
    patch = next(one for one in candidates(model) if any("patch_x_m" in name for name in one.names))
    size = patch.tries[0]
    half = patch.share(size, 0.5)
    assert half[patch.shape].tolist() == size[patch.shape].tolist()
    assert half[~patch.shape] == pytest.approx(0.5 * (patch.origin + size)[~patch.shape])
    assert patch.shape.sum() == 3


def test_a_grain_is_tried_along_and_across_both_axes_and_diagonals() -> None:
    """An angle or a speed alone changes nothing: it is tried with every size, and a share of a size keeps it."""
    made = candidates(Model(nominal(robot()), ("friction_anisotropy", "stribeck"), ("friction_anisotropy", "stribeck")))
    grain, curve = (next(one for one in made if one.effect == name) for name in ("friction_anisotropy", "stribeck"))
    assert grain.shape.tolist() == curve.shape.tolist() == [False, True]
    for angle in (0.0, np.pi / 4, -np.pi / 4):
        found = grain.tries[np.isclose(grain.tries[:, 1], angle), 0]
        assert np.any(found > 1) and np.any(found < 1)
    assert np.all(curve.tries[:, 0] > 1) and len(set(curve.tries[:, 1])) > 1
    assert grain.share(grain.tries[-1], 0.5)[1] == grain.tries[-1, 1]


def test_over_which_length_a_friction_builds_up_is_no_size() -> None:
    """Without a friction it changes nothing: every try of the tendons has some, and half of it builds up as fast."""
    (one,) = candidates(Model(nominal(robot()), ("tendon_hysteresis",)))
    assert one.shape.tolist() == [False, True]
    assert np.all(one.tries[:, 0] > 0) and len(set(one.tries[:, 1])) > 1
    assert one.share(one.tries[-1], 0.5).tolist() == [0.5 * one.tries[-1, 0], one.tries[-1, 1]]


def test_what_is_a_nuisance_too_is_tried_from_where_the_refit_has_it(model: Model) -> None:
    """The camera of another engine is 20 ms early: tries lie about that, and what parity measured is added to it."""
    values = model.values0.copy()
    values[model.place["camera_delay.tau_s"]] = -0.02
    made = {one.effect: one for one in candidates(model, {"camera_delay": {"tau_s": 0.06}}, values=values)}
    late = made["camera_delay"]
    assert late.off.tolist() == [0.0] and late.origin.tolist() == [-0.02]
    assert late.tries[0] == pytest.approx([0.04])
    assert sorted((late.tries[1:, 0] + 0.02).tolist()) == pytest.approx(sorted((-late.tries[1:, 0] - 0.02).tolist()))
    assert late.share(late.tries[0], 0.5) == pytest.approx([0.01])
    assert made["payload"].origin.tolist() == made["payload"].off.tolist()


def test_parity_speaks_of_numbers_that_effects_have() -> None:
    """A size under a name that no effect has would be lost without a word."""
    own = {effect.name: {one.name for one in effect.own} for effect in CATALOGUE}
    for check in EXPECTED:
        for difference in (0.1, -0.1):
            for index in (None, 0):
                for one in suspicions(check, difference, index):
                    assert {name.split(".")[0] for name in one.size} <= own[one.effect], (check, one)
