"""Where a simulation leaves the finite numbers it stops, and says which step, body and term."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect, EffectParameter, with_off_values
from r2s2r_cli.effects.soft_ground import SoftGround
from r2s2r_cli.engine import (
    Channel,
    EngineInputError,
    NonFiniteError,
    Parameters,
    Simulator,
    State,
    Structure,
    closed_loop,
    flat_step,
    pack_parameters,
    pack_state,
)
from r2s2r_cli.engine.hooks import Values, WorldTerms
from r2s2r_cli.engine.nonfinite import require_finite
from tests.support.engine import G, free_rods, lying, parameters, simulator, state, vector
from tests.support.robots import rested, subject


def pair(**numbers: float | Tensor) -> tuple[Structure, Parameters, State]:
    """Three rods high in the air, a cable between the last two."""
    structure = Structure(n_rods=3, cable_rods=((1, 2),), actuated=(0,), rod_contact=False)
    theta = parameters(structure, gravity=torch.zeros(3), **numbers)
    p = torch.stack([vector(-1.0, 0.0, 2.0), vector(0.0, 0.0, 2.0), vector(0.3, 0.0, 2.0)])
    return structure, theta, state(structure, p, axis=vector(0.0, 0.0, 1.0), rest=torch.tensor([0.2]))


def caught(
    structure: Structure, theta: Parameters, start: State, *, steps: int = 100, every: int = 20
) -> NonFiniteError:
    """The error of a rollout with the motors off."""
    u = torch.zeros(max(len(start.p_WB), len(theta.mass)), 1, structure.n_actuated, dtype=torch.float64)
    with pytest.raises(NonFiniteError) as raised:
        simulator(structure).rollout(theta, start, u, hold=steps, every=every, substeps=1)
    return raised.value


def test_absurd_stiffness_without_substeps_names_the_cable() -> None:
    """A cable of 1e200 N/m tears its rods away within steps; both names and the step are those of a torch replay."""
    structure, theta, start = pair(stiffness=1e200)
    error = caught(structure, theta, start)
    assert error.environment == 0
    assert error.body.startswith(("cable 0", "rod 1"))
    # The replay by hand: the first step after which anything is not finite.
    fn, s, p = flat_step(structure), pack_state(structure, start), pack_parameters(structure, theta)
    u, h = torch.zeros(1, 1, dtype=torch.float64), torch.tensor([[1e-3]], dtype=torch.float64)
    k = 0
    while bool(torch.isfinite(s := fn(s, u, p, h)).all()):
        k += 1
    assert error.step == k
    assert error.time == pytest.approx(k * 1e-3)


def test_the_same_stiffness_with_automatic_substeps_is_no_error() -> None:
    """What explodes at 1 ms runs with the substeps that longest_step asks for."""
    structure, theta, start = pair(stiffness=1e6, damping=1.0)
    u = torch.zeros(1, 1, 1, dtype=torch.float64)
    assert simulator(structure).rollout(theta, start, u, hold=20, every=20).substeps > 1


def test_a_speed_beyond_all_numbers_names_the_rod() -> None:
    """A rod at 1.7e308 m/s, and as far out, leaves in the step of the arithmetic; the others are not blamed."""
    structure, theta, start = pair()
    v = torch.zeros(1, 3, 3, dtype=torch.float64)
    v[0, 0, 0] = 1.7e308
    far = start.p_WB.clone()
    far[0, 0, 0] = 1.7e308
    error = caught(structure, theta, replace(start, v_WB=v, p_WB=far), steps=2000, every=1000)
    assert error.body == "rod 0"
    assert error.term == "p_WB"
    # 1.7e305 m a step, and 0.097e308 m to go.
    assert 50 < error.step < 60


def test_a_wild_spin_names_the_gyroscopic_term() -> None:
    """w^2 overflows in the gyroscopic torque before anything else does."""
    structure = free_rods(2, rod_contact=False)
    p = torch.stack([vector(0.0, 0.0, 2.0), vector(1.0, 0.0, 2.0)])
    w = torch.stack([vector(0.0, 0.0, 1.0), vector(1e200, 0.0, 1e200)])
    error = caught(structure, parameters(structure), state(structure, p, w=w), steps=20)
    assert (error.step, error.time) == (0, 0.0)
    assert (error.body, error.term) == ("rod 1", "gyroscopic change of angular velocity")


def test_a_huge_rate_and_damping_name_the_cable() -> None:
    """At a rate of 1e200 m/s the cable's length overflows one step later: the cable is named, not what follows."""
    structure, theta, start = pair(damping=1e300)
    v = torch.zeros(1, 3, 3, dtype=torch.float64)
    v[0, 2, 0] = 1e200
    error = caught(structure, theta, replace(start, v_WB=v), steps=20)
    assert (error.step, error.body, error.term) == (1, "cable 0", "length")


def test_the_environment_is_named_and_the_frame_found() -> None:
    """One of three robots, from the middle of the run: its number, and a step inside the right frame."""
    structure, theta, start = pair()
    theta = theta.map(lambda x: x.expand(3, *x.shape[1:]))
    theta = replace(theta, stiffness=torch.tensor([[100.0], [100.0], [1e200]], dtype=torch.float64))
    slack = replace(start, rest=torch.full_like(start.rest, 0.31))
    # Rods drift apart at 1 m/s and make the third robot's cable taut after 10 steps.
    v = torch.zeros(1, 3, 3, dtype=torch.float64)
    v[0, 2, 0] = 1.0
    error = caught(structure, theta, replace(slack, v_WB=v), steps=60, every=20)
    assert error.environment == 2
    assert error.step >= 10
    assert f"step {error.step}" in str(error)
    assert error.body in str(error)
    assert error.term in str(error)


def test_a_start_that_is_no_number_is_refused_before_it_runs() -> None:
    """NaN in a state is an input error with the field named, not a failure of the simulation."""
    structure, theta, start = pair()
    bad = start.p_WB.clone()
    bad[0, 1, 2] = torch.nan
    with pytest.raises(EngineInputError) as raised:
        simulator(structure).rollout(theta, replace(start, p_WB=bad), torch.zeros(1, 1, 1, dtype=torch.float64))
    assert raised.value.field == "p_WB.1.2"


@pytest.mark.parametrize("bad", [torch.inf, -torch.inf, torch.nan])
def test_commands_that_are_no_numbers_are_refused(bad: float) -> None:
    """An infinite command is no command, though clamping would make one of it."""
    structure, theta, start = pair()
    with pytest.raises(EngineInputError) as raised:
        simulator(structure).rollout(theta, start, torch.full((1, 3, 1), bad, dtype=torch.float64))
    assert raised.value.field == "commands"


def test_the_frames_themselves_are_told_from_the_start() -> None:
    """Given frames whose first is not finite there is no step to blame: the start is."""
    structure = free_rods()
    theta, start = parameters(structure), lying(structure)
    frames = pack_state(structure, start)[:, None].repeat(1, 3, 1)
    u, p = torch.zeros(1, 2, 0, dtype=torch.float64), pack_parameters(structure, theta)
    require_finite(structure, flat_step(structure), frames, u, p, h=1e-3, hold=1, every=1)
    with pytest.raises(NonFiniteError) as raised:
        require_finite(structure, flat_step(structure), frames * torch.nan, u, p, h=1e-3, hold=1, every=1)
    assert (raised.value.body, raised.value.step) == ("the start", 0)


def test_frames_that_torch_does_not_repeat_are_errors_all_the_same() -> None:
    """Should machine code alone leave the finite numbers, the error still comes, with the frames it lies between."""
    structure = free_rods()
    theta, start = parameters(structure), lying(structure)
    frames = pack_state(structure, start)[:, None].repeat(1, 3, 1)
    frames[:, 2] = torch.inf
    u, p = torch.zeros(1, 2, 0, dtype=torch.float64), pack_parameters(structure, theta)
    with pytest.raises(NonFiniteError, match="between two frames") as raised:
        require_finite(structure, flat_step(structure), frames, u, p, h=1e-3, hold=1, every=1)
    assert raised.value.step == 2


def test_torch_and_machine_code_name_the_same() -> None:
    """Without machine code the same run raises the same error."""
    structure, theta, start = pair(stiffness=1e200)
    native = caught(structure, theta, start)
    u = torch.zeros(1, 1, 1, dtype=torch.float64)
    with pytest.raises(NonFiniteError) as raised:
        Simulator(structure, native=False).rollout(theta, start, u, hold=100, every=20, substeps=1)
    assert str(raised.value) == str(native)


def test_the_closed_loop_stops_too() -> None:
    """A policy on a robot under absurd gravity is an error, and not a run of NaN."""
    robot = subject()
    heavy = replace(robot.theta, gravity=robot.theta.gravity * 1e307 / G)
    with pytest.raises(NonFiniteError):
        closed_loop(robot.simulator, heavy, rested().state, robot.pid(), torch.zeros(1, 6, dtype=torch.float64),
                    torch.zeros(1), torch.tensor([0.2]))  # fmt: skip


class _Torn(Effect):
    name = "torn"
    channel = Channel.WORLD
    title = "a force beyond all numbers"
    own = (EffectParameter("force_n", "N", 0.0, 1.0, off=0.0, scale=1.0, what="times 1e400, upwards"),)

    @classmethod
    def signature(cls) -> str:
        """Gone."""
        return "gone"

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Infinite but for 0."""
        return force + terms.R_GR[..., 2] * (x["force_n"] * 1e200)[..., None] * 1e200, torque


def test_the_culprit_is_named_on_soft_ground_as_well() -> None:
    """A ground that gives way has a memory, which the search for the first bad term needs as the step does."""
    plain, theta, start = pair()
    structure = plain.with_effects(SoftGround(), _Torn())
    theta = with_off_values(structure, theta)
    theta = theta.with_values({"torn.force_n": torch.ones(1, 1, dtype=torch.float64)})
    sunk = torch.zeros(1, 6, dtype=torch.float64)
    error = caught(structure, theta, replace(start, extra={"soft_ground.sunk": sunk}), steps=1, every=1)
    assert (error.step, error.term) == (0, "v_WB")
    assert error.body.startswith("rod")
