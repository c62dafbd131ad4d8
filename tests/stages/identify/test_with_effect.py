"""`--with-effect`: which numbers become free, what the next iteration keeps, and planted effects that come back.

The planted robots are simulated by this very engine: the tests say that the fit works, nothing about real robots.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import with_off_values
from r2s2r_cli.effects.known import known_effects
from r2s2r_cli.engine import Simulator, observe
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.effects_asked import effects_asked, effects_kept
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free import Mapping, catalogue, select
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import specs_asked
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.model import parameters_of, structure_of
from schemas.config import IdentifySettings
from tests.stages.identify.planted import SPEED, found
from tests.stages.identify.replayed import GAIT, PERIOD, STEP, predictor_of, start, walk
from tests.support.engine import threebar
from tests.support.variants import with_memory

NOISE = 1e-3
TRAIN = (Selection("walk", (1, 2, 3, 4, 5)),)


def test_an_effect_frees_its_numbers() -> None:
    """Robot-wide ones by name, those of elements all, or the one of the element that is named."""
    made = effects_asked(["ground_slope", "cap_friction", "payload:1"], threebar())
    assert made.ids == ("ground_slope", "cap_friction", "payload")
    assert made.specs == (
        "ground_slope.angle_x_rad", "ground_slope.angle_y_rad", "cap_friction.factor.*", "payload.mass_kg.1",
        "payload.place_m.1",
    )  # fmt: skip
    frees = select(made.specs, threebar(), made.ids)
    assert [free.name for free in frees if free.name.startswith("cap")] == [
        f"cap_friction.factor.{k}" for k in range(6)
    ]
    # Those that are looked for only where they are named as well.
    further = effects_asked(["air_drag", "obstacle"], threebar())
    assert further.specs == (
        "air_drag.drag_n_s_per_m", "obstacle.height_m", "obstacle.ridge_distance_m", "obstacle.ridge_angle_rad",
        "obstacle.ridge_width_m",
    )  # fmt: skip
    assert effects_asked(["none"], threebar()) == effects_asked([], threebar())


@pytest.mark.parametrize(
    ("words", "what", "hint"),
    [
        (["payloda"], "unknown effect", "--with-effect payload"),
        (["nonsense"], "unknown effect", "r2s2r effects"),
        (["payload:7"], "no element '7'", "--with-effect payload:0"),
        (["stribeck:1"], "stribeck has no elements", "--with-effect stribeck"),
        (["none", "payload"], "none and an effect", "--with-effect none"),
        (["payload", "dropout"], "dropout has no number", "r2s2r identify"),
    ],
)
def test_what_cannot_be(words: list[str], what: str, hint: str) -> None:
    """Is refused by name, with what can be pasted instead."""
    with pytest.raises(UsageError, match=what) as caught:
        effects_asked(words, threebar())
    assert hint in str(caught.value.hint)


def test_numbers_that_are_named_or_fixed_stay_as_they_are_asked_for() -> None:
    """The effect's other numbers are free beside them."""
    asked = effects_asked(["payload:0", "motor_lag"], threebar())
    request = Request(
        TRAIN, free=("friction", "motor_lag.tau_s=0.1"), fixed={"payload.place_m.0": 0.1}, effects=asked.ids,
        of_effects=asked.specs,
    )  # fmt: skip
    specs = specs_asked(request, IdentifySettings(), ("mass",))
    assert specs == ("friction", "motor_lag.tau_s=0.1", "payload.mass_kg.0")


@pytest.mark.parametrize("free", [(), ("friction",), ("motor_speed_mismatch.factor.*,~0.2",)])
def test_elements_that_are_fixed_leave_the_others_of_their_family_free(free: tuple[str, ...]) -> None:
    """Whether the family comes with the effect or was named: two winches that never turned are fixed, as the hint of
    the refusal says, and the other four are free."""
    asked = effects_asked(["motor_speed_mismatch"], threebar())
    still = {f"motor_speed_mismatch.factor.{k}": 1.0 for k in (2, 5)}
    request = Request(TRAIN, free=free, fixed=still, effects=asked.ids, of_effects=asked.specs)
    frees = select(specs_asked(request, IdentifySettings(), ("mass",)), threebar(), asked.ids, still)
    found = {one.name: one for one in frees if one.name.startswith("motor_speed_mismatch")}
    assert list(found) == [f"motor_speed_mismatch.factor.{k}" for k in (0, 1, 3, 4)]
    assert all(one.prior_sd == 0.2 for one in found.values()) == ("~0.2" in " ".join(free))


def test_the_next_iteration_keeps_the_effect_and_starts_from_it() -> None:
    """Of an artifact: its effects, and the free numbers of theirs at the values found, off the bounds; numbers of the
    robot and of effects that were fixed by hand are none of them."""
    own = catalogue(threebar())
    tau, slope = own["motor_lag.tau_s"], own["ground_slope.angle_x_rad"]
    table = (
        ParameterFound(tau, 0.0, 0.01, 0.0, 0.03, (math.nan, math.nan), Trust.IDENTIFIED, ""),
        ParameterFound(slope, 0.03, 0.001, 0.028, 0.032, (math.nan, math.nan), Trust.IDENTIFIED, ""),
        ParameterFound(SPEED, 0.9, 0.01, 0.88, 0.92, (math.nan, math.nan), Trust.IDENTIFIED, ""),
        ParameterFound(own["ground_slope.angle_y_rad"], 0.01, math.nan, math.nan, math.nan, (math.nan, math.nan), None),
    )
    request = replace(found().request, effects=("motor_lag", "ground_slope"))
    before = identification(
        found(
            request=request,
            parameters=table,
            covariance=None,
            information=None,
            trace=(),
            starts=(),
            profiles=(),
            updates=(),
        )
    )
    kept = effects_kept(before, threebar())
    assert kept.ids == ("motor_lag", "ground_slope")
    assert kept.fixed == {"ground_slope.angle_y_rad": 0.01}
    assert kept.specs == ("motor_lag.tau_s=0.005", "ground_slope.angle_x_rad=0.03")
    starts = [free.start for free in select(kept.specs, threebar(), kept.ids)]
    assert starts == [0.005, 0.03]


PLANTED = {
    "command_latency.tau_s": 0.08, "tendon_set.shift_m.6": 0.006,
    "com_offset.axial_m.1": 0.012, "soft_ground.compliance_m_per_n": 1.5e-3, "camera_scale.factor": 1.02,
    "air_drag.drag_n_s_per_m": 1.5,
}  # fmt: skip


def planted(name: str, size: float) -> RunData:
    """The walk of 3.5 s of a robot with one effect, its commands as sent and its caps as seen, with 1 mm of noise."""
    run = walk(5, seconds=0.7)
    effect = next(one for one in known_effects() if one.name == name.split(".")[0])
    structure = structure_of(threebar()).with_effects(effect)
    theta = with_off_values(structure, parameters_of(threebar()))
    field = ".".join(name.split(".")[:2])
    value = theta.extra[field].clone()
    value[:, int(name.split(".")[2]) if name.count(".") == 2 else slice(None)] = size
    theta = theta.with_values({field: value})
    each = round(PERIOD / STEP)
    rows = torch.as_tensor(np.repeat(run.control[:-1], each, axis=0))[None]
    path = Simulator(structure).rollout(theta, with_memory(structure, start()), rows, step=STEP, every=each)
    seen = observe(structure, theta, path.t, path.end_caps())[0].numpy()
    noisy = seen + NOISE * np.random.default_rng(4).normal(size=seen.shape)
    sd = np.full(seen.shape, NOISE)
    return replace(run, observed=noisy, p_WE=seen, noise=sd[0], sd_p=sd)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_effect_comes_back(name: str) -> None:
    """With motor speed and friction free beside it: its size to 10 %, from its start near the off value; and without
    it the best fit is worse by more than chance."""
    run, size = planted(name, PLANTED[name]), PLANTED[name]
    costs = []
    for specs in (("motor_speed", "friction"), ("motor_speed", "friction", f"{name},~inf")):
        predictor = predictor_of(*specs)
        begin = with_memory(predictor.structure, start())
        fitted = fit([run], TRAIN, predictor, Recipe(noise=NOISE, filtered=0), known={"walk": begin})
        costs.append(fitted.solution.cost)
    off = next(
        own.off for effect in known_effects() for own in effect.own if name.startswith(f"{effect.name}.{own.name}")
    )
    assert fitted.values[2] - off == pytest.approx(size - off, rel=0.1)
    assert fitted.values[0] == pytest.approx(0.8, rel=0.01)
    assert costs[0] > costs[1] + 20


def test_an_identified_effect_stays_for_whoever_simulates() -> None:
    """The mapping of an identification with an effect has it in its structure, and its delay in the link."""
    mapping = Mapping(threebar(), select(("payload.mass_kg.0", "command_latency.tau_s"), threebar()), ("payload",))
    assert {effect.name for effect in mapping.structure.effects} == {"payload", "command_latency"}
    assert mapping.observation(np.array([0.02, 0.06])).command_delay == pytest.approx(0.06)
    assert GAIT.shape[1] == len(threebar().actuated)
