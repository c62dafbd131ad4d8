"""Every method on a run that does not show an effect leaves it off exactly; where it is there, it is found.

The planted robots are simulated by this very engine: the tests say that the fits work, nothing about real robots.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import Simulator
from r2s2r_cli.stages.identified import identified
from r2s2r_cli.stages.identify import held_out as judge
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.effects_asked import effects_asked
from r2s2r_cli.stages.identify.found import Found, ParameterFound
from r2s2r_cli.stages.identify.free import Mapping, select
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.identify import find
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from schemas.config import IdentifySettings
from tests.stages.identify.planted import found as planted
from tests.stages.identify.planted_loop import GAIT, crawl
from tests.stages.identify.replayed import start, walk
from tests.support.engine import threebar
from tests.support.variants import with_memory

SPEED = 0.7
OFF = {
    "obstacle.height_m": 0.0, "obstacle.ridge_distance_m": 0.0, "obstacle.ridge_angle_rad": 0.0,
    "obstacle.ridge_width_m": 0.03,
}  # fmt: skip
METHODS: dict[str, dict[str, Any]] = {
    "default": {}, "cma": {"method": "cma"}, "closed loop": {"drive": "closed loop"},
    "paper": {"method": "paper"}, "paper in closed loop": {"method": "paper", "drive": "closed loop"},
    "online": {"online": True},
}  # fmt: skip


@pytest.fixture(autouse=True)
def no_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rivals are fits of their own, which other tests look at."""
    monkeypatch.setattr(judge, "_rivals", lambda *arguments: ({}, 0, []))


def found_of(run: RunData, count: int, *effects: str, iterations: int, **request: Any) -> Found:
    """Motor speed and these effects, from the first intervals."""
    asked = effects_asked(effects, threebar())
    train = (Selection(run.name, tuple(range(1, count + 1))),)
    wanted = Request(train, free=("motor_speed", *asked.specs), effects=asked.ids, **request)
    settings = IdentifySettings(starts=1, profiles=0, max_iterations=iterations)
    return find(threebar(), [run], wanted, settings)


def before() -> Any:
    """An earlier identification, of the speed alone."""
    nothing = {"covariance": np.array([[0.01]]), "information": None, "trace": (), "starts": (), "profiles": ()}
    (speed,) = select(("motor_speed",), threebar())
    known = ParameterFound(speed, 0.75, 0.07, 0.6, 0.9, (math.nan, math.nan), Trust.IDENTIFIED)
    return identification(planted(parameters=(known,), updates=(), **nothing))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_ridge_that_nobody_met_is_not_in_the_model(method: str) -> None:
    """Its height is off and what it would be like at the mean of its prior, to the last bit, and both are said to be
    held; the speed is found beside it; and the model walks as a robot with that speed and without the effect does."""
    request = METHODS[method] | ({"before": before()} if method == "online" else {})
    made = found_of(crawl(4, values=(("motor_speed", SPEED),)), 4, "obstacle", iterations=8, **request)
    values = {one.free.name: one.value for one in made.parameters}
    assert {name: values[name] for name in OFF} == OFF
    for one in made.parameters[1:]:
        assert one.trust is Trust.NOT_IDENTIFIABLE and not one.identifiable
        assert f"prior sd {one.free.prior_sd:.3g}" in one.reason and "held at" in one.reason
    # Adam goes about the minimum in steps of up to 0.1.
    assert values["motor_speed"] == pytest.approx(SPEED, abs=0.11 if method == "paper" else 0.02)
    table = identification(made).groups["parameters"]
    assert np.isnan(table["sd"][1:]).all() and (table["prior_sd"][1:] > 0).all()
    assert table["prior_mean"][1:].tolist() == list(OFF.values())

    model = identified(identification(made), threebar())
    assert [effect.name for effect in model.structure.effects] == ["obstacle"]
    bare = Mapping(threebar(), select(("motor_speed",), threebar()), fixed=model.mapping.fixed)
    u = torch.as_tensor(np.repeat(2.0 * GAIT - 1.0, 500, axis=0))[None]
    with torch.no_grad():
        own, plain = (
            Simulator(structure).rollout(theta, with_memory(structure, start()), u, step=1e-3, every=100).end_caps()
            for structure, theta in (
                (model.structure, model.theta), (bare.structure, bare.theta(np.array([values["motor_speed"]]))),
            )
        )  # fmt: skip
    np.testing.assert_array_equal(own.numpy(), plain.numpy())


@pytest.mark.slow
@pytest.mark.parametrize("method", ["default", "closed loop"])
def test_a_slope_that_is_there_is_found(method: str) -> None:
    """0.06 rad, three sd of its prior: identified, and nearer to the truth than to none."""
    truth = (("motor_speed", SPEED), ("ground_slope.angle_x_rad", 0.06))
    made = found_of(crawl(4, values=truth), 4, "ground_slope", iterations=8, **METHODS[method])
    slope = made.parameters[1]
    assert slope.free.name == "ground_slope.angle_x_rad" and slope.trust is Trust.IDENTIFIED
    assert 0.035 < slope.value < 0.07


@pytest.mark.slow
def test_what_an_effect_is_like_is_found_where_the_effect_is_there() -> None:
    """A payload of 50 g, 100 mm from the middle of a rod: with 3 g, where the fit begins, no frame shows the place."""
    truth = (("motor_speed", SPEED), ("payload.mass_kg.0", 0.05), ("payload.place_m.0", 0.1))
    made = found_of(walk(5, seconds=0.7, values=truth, noise=1e-3), 4, "payload:0", iterations=6)
    _, mass, place = made.parameters
    assert mass.trust is place.trust is Trust.IDENTIFIED
    assert mass.value == pytest.approx(0.05, abs=0.012) and place.value == pytest.approx(0.1, abs=0.035)
    assert made.information is not None and made.information.trust[2] is Trust.NOT_IDENTIFIABLE


@pytest.mark.slow
def test_a_fit_that_is_made_again_says_only_what_was_made_last() -> None:
    """Soft ground, fitted to a robot with a payload on hard ground, is hard: nothing shows how fast it gives way, and
    its time constant moves in a first fit and is held in the second. Interrupted in either, the same comes out."""
    truth = (("motor_speed", SPEED), ("payload.mass_kg.0", 0.05), ("payload.place_m.0", 0.1))
    run = walk(5, seconds=0.7, values=truth, noise=1e-3)
    saves: list[dict[str, Any]] = []

    class Kept:
        """A checkpoint that keeps all that was saved, and begins with one of it."""

        def __init__(self, first: dict[str, Any] | None = None) -> None:
            self.first = first

        def load(self) -> dict[str, Any] | None:
            return self.first

        def save(self, values: Any) -> None:
            if self.first is None:
                saves.append(dict(values))

    asked = effects_asked(["soft_ground"], threebar())
    wanted = Request((Selection("walk", (1, 2, 3, 4)),), free=("motor_speed", *asked.specs), effects=asked.ids)
    settings = IdentifySettings(starts=1, profiles=0, max_iterations=4)
    made = find(threebar(), [run], wanted, settings, checkpoint=Kept())
    values = {one.free.name: (one.value, one.trust) for one in made.parameters}
    assert values["soft_ground.tau_s"] == (0.02, Trust.NOT_IDENTIFIABLE)
    assert values["soft_ground.compliance_m_per_n"][1] is Trust.IDENTIFIED
    again = [one for one in saves if "soft_ground.tau_s" in one.get("held", ())]
    assert 0 < len(again) < len(saves)
    assert len(made.trace) < sum(len(one["trace"]) for one in (saves[len(saves) - len(again) - 1], again[-1]))
    for one in (saves[1], again[0], again[-1]):
        resumed = find(threebar(), [run], wanted, settings, checkpoint=Kept(one))
        assert [p.value for p in resumed.parameters] == [p.value for p in made.parameters]
        assert [step.cost for step in resumed.trace] == [step.cost for step in made.trace]
