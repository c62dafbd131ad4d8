"""Defects that a review found, kept from coming back: each failed before its cure."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect, EffectParameter
from r2s2r_cli.engine import Channel, EngineInputError, Parameters, Simulator, Structure, end_caps, read
from r2s2r_cli.engine.hooks import CableTerms, Values
from r2s2r_cli.engine.structure import Detach
from r2s2r_cli.engine.trace_key import trace_key
from tests.support.engine import HALF, MASS, free_rods, parameters, roll, simulator, state, vector
from tests.support.robots import rested, subject


@pytest.mark.parametrize("x", [2.0, 8.0, 12.0, 20.0, 50.0])
def test_a_flat_landing_stops_rods_of_any_mass_distribution(x: float) -> None:
    """m l^2 / I from a dumb-bell to a rod heavy in its middle: both caps are stopped in the step in which they land."""
    structure = free_rods()
    inertia = torch.diag(vector(MASS * HALF**2 / x, MASS * HALF**2 / x, 1e-5))
    theta = parameters(structure, inertia=inertia[None, None], friction=0.0, restitution=0.0)
    start = state(structure, vector(0.0, 0.0, float(theta.cap_radius[0, 0, 0]) + 1e-4)[None], v=vector(0.0, 0.0, -1.0))
    end = roll(structure, theta, start, 1, 1e-3)[-1]
    assert float(end.v_WB[0, 0, 2].abs()) < 1e-9 and float(end.w_R.abs().max()) < 1e-7


class _Scaled(Effect):
    channel = Channel.CABLE
    title = "cable forces times a factor"
    own = (EffectParameter("factor", "1", 0.0, 2.0, off=1.0, scale=0.1, what="of every force"),)

    def __init__(self, name: str) -> None:
        self.name = name

    @classmethod
    def signature(cls) -> str:
        """Weaker everywhere."""
        return "weaker everywhere"

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Scaled force."""
        return terms.force * x["factor"], z


def test_two_cable_effects_are_read_as_they_are_simulated() -> None:
    """Both halve every cable's force: a quarter is read, not a half."""
    model, lying = subject(), rested().state
    taut = replace(lying, rest=0.95 * lying.rest)
    plugged = model.structure.with_effects(_Scaled("one"), _Scaled("two"))
    half = torch.full((1, 1), 0.5, dtype=torch.float64)
    theta = model.theta.with_values({"one.factor": half, "two.factor": half})
    assert torch.allclose(read(plugged, theta, taut).tension, 0.25 * read(model.structure, model.theta, taut).tension)


def test_instances_of_an_effect_are_told_apart() -> None:
    """Two instances with different attributes are different laws, with different machine code."""
    model = subject()
    keys = [trace_key(model.structure.with_effects(_Scaled(name))) for name in ("one", "two")]
    assert _Scaled("one") != _Scaled("two") and keys[0] != keys[1]


class _Longer(Effect):
    name = "longer"
    channel = Channel.MASS
    title = "longer rods"
    own = (EffectParameter("factor", "1", 0.5, 2.0, off=1.0, scale=0.1, what="of the rods' length"),)

    @classmethod
    def signature(cls) -> str:
        """Longer."""
        return "rods are longer"

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Caps further out."""
        return replace(theta, p_BE=theta.p_BE * x["factor"][..., None, None])


def test_end_caps_of_a_run_are_those_of_its_effects() -> None:
    """An effect that moves the caps moves them in the trajectory as well, as the equivalent nominal robot has them."""
    structure = free_rods()
    plugged = structure.with_effects(_Longer())
    nominal = parameters(structure)
    theta = nominal.with_values({"longer.factor": torch.full((1, 1), 1.2, dtype=torch.float64)})
    start = state(structure, vector(0.0, 0.0, 1.0)[None])
    idle = torch.zeros(1, 10, 0, dtype=torch.float64)
    run = Simulator(plugged, native=False).rollout(theta, start, idle)
    assert torch.allclose(run.end_caps()[:, -1], end_caps(replace(nominal, p_BE=nominal.p_BE * 1.2), run.at(-1)))


def test_what_a_structure_leaves_out_must_not_be_there() -> None:
    """Caps off the axis and a skew inertia are refused where the structure is axial; unknown modes of detaching too."""
    structure = free_rods()
    theta = parameters(structure)
    start, idle = state(structure, vector(0.0, 0.0, 1.0)[None]), torch.zeros(1, 1, 0, dtype=torch.float64)
    skew = theta.inertia.clone()
    skew[..., 0, 1] = skew[..., 1, 0] = 1e-4
    for field, wrong in (("p_BE", theta.p_BE + 0.01), ("inertia", skew)):
        with pytest.raises(EngineInputError) as error:
            simulator(structure).rollout(replace(theta, **{field: wrong}), start, idle)
        assert error.value.field == field
    with pytest.raises(EngineInputError) as error:
        Structure(1, (), (), detach="all")  # type: ignore[arg-type]
    assert error.value.field == "detach"


def test_changed_in_place_is_looked_at_again() -> None:
    """Parameters that were good and are overwritten in place are checked again."""
    structure = free_rods()
    theta = parameters(structure).map(torch.clone)
    start, idle = state(structure, vector(0.0, 0.0, 1.0)[None]), torch.zeros(1, 1, 0, dtype=torch.float64)
    simulation = Simulator(structure, native=False)
    simulation.rollout(theta, start, idle)
    theta.mass[:] = -1.0
    with pytest.raises(EngineInputError) as error:
        simulation.rollout(theta, start, idle)
    assert error.value.field.startswith("mass")


def test_torch_only_means_torch_only() -> None:
    """With native=False nothing is compiled, tangents included, and they are those of the kernels."""
    structure = free_rods()
    theta = parameters(structure)
    start, idle = state(structure, vector(0.0, 0.0, 0.05)[None]), torch.zeros(1, 5, 0, dtype=torch.float64)
    plain, kernels = Simulator(structure, native=False), simulator(structure)
    directions = torch.eye(kernels.kernels.sizes.n_state, dtype=torch.float64)[:, :4]
    _, tangents = plain.jvp(theta, start, idle, d_state=directions)
    _, native = kernels.jvp(theta, start, idle, d_state=directions)
    assert not plain.kernels.build_log and torch.allclose(tangents, native, rtol=1e-10, atol=1e-12)


def test_detached_impulses_warn_wherever_they_run() -> None:
    """The warning of detach="impulse" comes in jvp as well."""
    structure = replace(free_rods(), detach=Detach.IMPULSE)
    theta = parameters(structure)
    start, idle = state(structure, vector(0.0, 0.0, 1.0)[None]), torch.zeros(1, 1, 0, dtype=torch.float64)
    with pytest.warns(RuntimeWarning, match="impulse"):
        Simulator(structure, native=False).jvp(
            theta, start, idle, d_state=torch.zeros(13, 1, dtype=torch.float64), step=0.1, hold=6
        )


class _Shifted(Effect):
    name = "shifted"
    channel = Channel.OBSERVATION
    title = "a camera that stands elsewhere"
    own = (EffectParameter("offset_m", "m", -1.0, 1.0, off=0.0, scale=0.01, what="along x"),)

    @classmethod
    def signature(cls) -> str:
        """Everything is elsewhere."""
        return "everything is elsewhere"

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """Caps moved along x."""
        return p_WE + x["offset_m"][:, None, None] * vector(1.0, 0.0, 0.0)


def test_a_trajectory_is_observed_through_its_effects() -> None:
    """An effect of channel observation moves what is observed, and not what is."""
    structure = free_rods().with_effects(_Shifted())
    theta = parameters(free_rods()).with_values({"shifted.offset_m": torch.full((1, 1), 0.02, dtype=torch.float64)})
    idle = torch.zeros(1, 3, 0, dtype=torch.float64)
    run = Simulator(structure, native=False).rollout(theta, state(structure, vector(0.0, 0.0, 1.0)[None]), idle)
    assert torch.allclose(run.observed() - run.end_caps(), 0.02 * vector(1.0, 0.0, 0.0).expand(1, 4, 2, 3))
