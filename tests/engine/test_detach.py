"""The paper's Algorithms 1 to 3: what they compute, which derivative they mean, and where the printed forms fail."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor

import r2s2r_cli.engine.detach as module
from r2s2r_cli.engine.detach import (
    DetachBodies,
    algorithm_1,
    algorithm_2,
    algorithm_3,
    collision,
    detach_geometry,
    detach_impulse,
    friction,
    restitution,
    restitution_toi,
)

Form = Callable[..., tuple[Tensor, Tensor]]
G, DT, M = 9.81, 1e-2, 2.0


def number(value: float) -> Tensor:
    """A float64 scalar that asks for its gradient."""
    return torch.tensor(value, dtype=torch.float64, requires_grad=True)


def slopes(of: Tensor, *inputs: Tensor) -> list[float]:
    """Derivatives of a scalar, zero where the graph does not reach."""
    if not of.requires_grad:
        return [0.0] * len(inputs)
    found = torch.autograd.grad(of, inputs, retain_graph=True, allow_unused=True)
    return [0.0 if g is None else float(g) for g in found]


def fall(step: Form, steps: int, x: Tensor, e: Tensor, dt: float) -> tuple[Tensor, Tensor]:
    """Position and velocity of a ball after `steps` steps under gravity alone, from rest at x, the whole graph kept."""
    v, force = torch.zeros_like(x), torch.zeros_like(x)
    for _ in range(steps):
        x, v = step(x, v, force, e=e, mass=M, gravity=G, dt=dt, detach=False)
    return x, v


@pytest.mark.parametrize("form", [algorithm_1, restitution])
@pytest.mark.parametrize("detach", [True, False])
def test_algorithm_1_in_contact(form: Form, detach: bool) -> None:
    """Detached, the derivatives are the intended ones (dv/dF = dt/m, dv/dv = 1, dx/dx = 1); whole, the plain ones."""
    x, v, force, e = number(-1e-3), number(-0.4), number(1.0), number(0.6)
    after = form(x, v, force, e=e, mass=M, gravity=G, dt=DT, detach=detach)
    v_new = -0.4 - G * DT + 1.0 / M * DT
    assert after[1].item() == pytest.approx(-0.6 * v_new)
    assert after[0].item() == pytest.approx(0.0 - 0.6 * v_new * DT)
    dv = [1.0, DT / M, -v_new] if detach else [-0.6, -0.6 * DT / M, -v_new]
    assert slopes(after[1], v, force, e) == pytest.approx(dv)
    assert slopes(after[0], x) == pytest.approx([1.0 if detach else 0.0])


def test_the_whole_graph_also_reaches_restitution() -> None:
    """Against the paper's text, dx/de of one step is -v' dt with and without detachment, not zero without."""
    for detach in (True, False):
        e = number(0.6)
        x, _ = algorithm_1(number(-1e-3), number(-0.4), number(1.0), e=e, mass=M, gravity=G, dt=DT, detach=detach)
        assert slopes(x, e) == pytest.approx([-(-0.4 - G * DT + DT / M) * DT])


@pytest.mark.parametrize("detach", [True, False])
def test_drone_that_cannot_lift_keeps_its_trend(detach: bool) -> None:
    """On the ground with F < m g, dx_n/dF is n(n+1)/2 dt^2/m detached and exactly zero otherwise; x stays 0."""
    force, n = number(0.5 * M * G), 20
    x = v = torch.zeros((), dtype=torch.float64)
    for _ in range(n):
        x, v = restitution(x, v, force, e=0.0, mass=M, gravity=G, dt=DT, detach=detach)
    assert x.item() == 0.0
    assert slopes(x, force) == pytest.approx([n * (n + 1) / 2 * DT**2 / M if detach else 0.0])


def test_algorithm_1_as_printed_bounces_in_the_air() -> None:
    """Printed, a ball in free flight has v = -e v' and a drone with e = 0 never lifts off; corrected, not."""
    x, v, none = number(5.0), number(-1.0), torch.zeros((), dtype=torch.float64)
    v_new = -1.0 - G * DT
    assert algorithm_1(x, v, none, e=0.5, mass=M, gravity=G, dt=DT)[1].item() == pytest.approx(-0.5 * v_new)
    assert restitution(x, v, none, e=0.5, mass=M, gravity=G, dt=DT)[1].item() == pytest.approx(v_new)
    lift = number(10 * M * G)
    assert algorithm_1(none, none, lift, e=0.0, mass=M, gravity=G, dt=DT)[1].item() == 0.0
    assert restitution(none, none, lift, e=0.0, mass=M, gravity=G, dt=DT)[1].item() == pytest.approx(9 * G * DT)


@pytest.mark.parametrize("pull", [3.0, -3.0])
@pytest.mark.parametrize("mu", [0.8, 0.1])
def test_algorithm_2_detached(pull: float, mu: float) -> None:
    """Corrected, dv/dmu is -N dt/m along the pull in stick and in slip, dv/dF is dt/m; printed, the sign of stick is
    that of a pull to the right whatever the pull."""
    normal, sign = 1.0 * G, math.copysign(1.0, pull)
    sticks = mu * normal > abs(pull)
    for form in (algorithm_2, friction):
        force, coefficient = number(pull), number(mu)
        at = torch.zeros(1, dtype=torch.float64)
        k = coefficient if form is friction else coefficient.reshape(1)
        _, after = form(at, at, force.reshape(1), mu=k, normal=normal, mass=1.0, dt=DT)
        slips = pull - sign * mu * normal
        assert after.item() == pytest.approx(0.0 if sticks else slips * DT, abs=1e-15)
        printed = 1.0 if form is algorithm_2 and sticks else sign
        assert slopes(after.sum(), force, coefficient) == pytest.approx([DT, -printed * normal * DT])


@pytest.mark.parametrize("mu", [0.8, 0.1])
def test_algorithm_2_whole(mu: float) -> None:
    """With the whole graph a stuck box has no derivative at all, a sliding one that of central differences."""
    for form in (algorithm_2, friction):
        force, coefficient = number(3.0), number(mu)
        at = torch.zeros(1, dtype=torch.float64)

        def speed(f: Tensor, k: Tensor, form: Form = form, at: Tensor = at) -> Tensor:
            return form(at, at, f.reshape(1), mu=k.reshape(()), normal=G, mass=1.0, dt=DT, detach=False)[1].sum()

        found = slopes(speed(force, coefficient), force, coefficient)
        assert found == ([0.0, 0.0] if mu == 0.8 else pytest.approx([DT, -G * DT]))
        assert torch.autograd.gradcheck(speed, (force, coefficient))


@pytest.mark.parametrize("mu", [0.9, 0.2])
def test_friction_in_the_plane(mu: float) -> None:
    """In 2-D friction acts against the motion to come, and detached dv/dmu is -N dt/m along it, at every heading."""
    angle = torch.linspace(0.1, 6.1, 7, dtype=torch.float64)
    heading = torch.stack([angle.cos(), angle.sin()], -1)
    coefficient = torch.full((7,), mu, dtype=torch.float64, requires_grad=True)
    rest = torch.zeros(7, 2, dtype=torch.float64)
    _, v = friction(rest, rest, 4.0 * heading, mu=coefficient, normal=G, mass=1.0, dt=DT)
    expected = 0.0 if mu * G > 4 else (4.0 - mu * G) * DT
    torch.testing.assert_close(v.detach(), expected * heading, atol=1e-15, rtol=1e-12)
    for axis in range(2):
        (slope,) = torch.autograd.grad(v[:, axis].sum(), coefficient, retain_graph=True)
        torch.testing.assert_close(slope, -G * DT * heading[:, axis])


def test_friction_without_any_push_is_finite() -> None:
    """A body at rest without a force has no direction of motion: values and derivatives are zero or dt/m, never NaN."""
    force, coefficient = torch.zeros(2, dtype=torch.float64, requires_grad=True), number(0.5)
    rest = torch.zeros(2, dtype=torch.float64)
    for detach in (True, False):
        _, v = friction(rest, rest, force, mu=coefficient, normal=G, mass=1.0, dt=DT, detach=detach)
        by_force, by_mu = torch.autograd.grad(v.sum(), (force, coefficient), allow_unused=True)
        torch.testing.assert_close(by_force, torch.full((2,), DT if detach else 0.0, dtype=torch.float64))
        assert v.tolist() == [0.0, 0.0]
        assert by_mu is None or float(by_mu) == 0.0


@pytest.mark.parametrize("e", [0.0, 0.7])
@pytest.mark.parametrize("dt", [0.1, 0.03])
def test_algorithm_3_counts_the_position_twice(e: float, dt: float) -> None:
    """Without gravity a bounce is known exactly. Corrected, it is met at every step; printed, the ball ends
    |v'| (dt - toi) too high, so that one with e = 0 rests above the ground."""
    height, speed = 0.02, 1.0
    x, v, none = number(height), number(-speed), torch.zeros((), dtype=torch.float64)
    exact = e * speed * (dt - height / speed)
    settings = {"e": e, "mass": M, "gravity": 0.0, "dt": dt}
    assert restitution_toi(x, v, none, **settings)[0].item() == pytest.approx(exact, abs=1e-15)
    assert algorithm_3(x, v, none, **settings)[0].item() == pytest.approx(exact + speed * (dt - height / speed))


def test_algorithm_3_takes_the_time_of_impact_from_the_old_velocity() -> None:
    """Just above the ground after the apex (v_t = 0), the printed time of impact exceeds the step and throws the ball
    below the ground; the corrected one keeps it above."""
    x, v, none = number(1e-6), number(0.0), torch.zeros((), dtype=torch.float64)
    settings = {"e": 0.0, "mass": M, "gravity": G, "dt": 1e-3}
    printed = algorithm_3(x, v, none, **settings)[0].item()
    assert printed == pytest.approx(9.81e-6 - 1e-2 * 9.81e-3, rel=1e-3)
    assert restitution_toi(x, v, none, **settings)[0].item() == pytest.approx(0.0, abs=1e-15)


def test_algorithm_3_bounces_in_the_air_too() -> None:
    """Printed, Algorithm 3 has the defect of Algorithm 1; corrected, a ball in flight falls."""
    x, v, none = number(5.0), number(-1.0), torch.zeros((), dtype=torch.float64)
    assert algorithm_3(x, v, none, e=0.5, mass=M, gravity=G, dt=DT)[1].item() == pytest.approx(0.5 * (1.0 + G * DT))
    assert restitution_toi(x, v, none, e=0.5, mass=M, gravity=G, dt=DT)[1].item() == pytest.approx(-1.0 - G * DT)


def test_bounce_converges_with_its_derivatives() -> None:
    """z(0.4 s) of a ball dropped from 0.3 m, e = 0.8, and its derivatives by height and by e converge, at first order,
    to those of the exact flight; dz/dz0 has the right sign (+0.31) already at 1 ms."""
    z0, e, t = 0.3, 0.8, 0.4
    hit = math.sqrt(2 * z0 / G)
    rest = t - hit
    exact = e * G * hit * rest - G * rest**2 / 2
    by_height = (-e * G * hit + (1 + e) * G * rest) / (G * hit)
    errors = []
    for dt in (1e-3, 2.5e-4):
        height, bounce = number(z0), number(e)
        x, _ = fall(restitution_toi, round(t / dt), height, bounce, dt)
        dz0, de = slopes(x, height, bounce)
        errors.append([abs(x.item() - exact), abs(dz0 - by_height), abs(de - G * hit * rest)])
    assert by_height == pytest.approx(0.311, abs=1e-3)
    assert errors[0][1] < 0.02
    for coarse, fine in zip(*errors, strict=True):
        assert fine < 0.4 * coarse


def test_detached_bounce_has_the_intended_derivative() -> None:
    """Across an impact, detached: dx/dx0 = 1 (the contact is not seen), dv/dF = dt/m, dv/de = -v_imp; whole, the
    derivative by e is the same and dx/dx0 is -e, as in the exact bounce without gravity."""
    step, e0 = 0.1, 0.7
    for detach, by_x in ((True, 1.0), (False, -e0)):
        x, v, force, e = number(0.02), number(-1.0), number(0.0), number(e0)
        after = restitution_toi(x, v, force, e=e, mass=M, gravity=0.0, dt=step, detach=detach)
        assert slopes(after[0], x) == pytest.approx([by_x])
        assert slopes(after[1], e) == pytest.approx([1.0])
        assert (slopes(after[1], force) == pytest.approx([step / M])) is detach


@pytest.mark.parametrize("form", [restitution, restitution_toi])
def test_whole_derivatives_are_the_true_ones(form: Form) -> None:
    """With the whole graph, all derivatives of position and velocity equal central differences in flight and impact."""
    for x, v in ((-0.02, -0.5), (0.004, -0.9), (0.5, -0.3)):
        inputs = (number(x), number(v), number(0.4), number(0.6))
        assert torch.autograd.gradcheck(
            lambda x, v, f, e: form(x, v, f, e=e, mass=M, gravity=G, dt=DT, detach=False), inputs
        )


def test_a_resting_ball_stays() -> None:
    """A ball with e = 0.8 that lies on the ground does not move in 1000 steps of the corrected Algorithm 3."""
    x, v = fall(restitution_toi, 1000, torch.zeros((), dtype=torch.float64), number(0.8), 1e-3)
    assert x.item() == 0.0
    assert v.item() == 0.0


def test_collision_keeps_momentum() -> None:
    """A collision keeps the momentum and reverses e times the approach; bodies that part are left alone."""
    v_A, v_B = torch.tensor([2.0, -1.0], dtype=torch.float64), torch.tensor([0.5, 0.5], dtype=torch.float64)
    after_A, after_B = collision(
        v_A, v_B, torch.tensor(True), e=0.6, mass_A=1.0, mass_B=3.0, bodies=DetachBodies.ACTUATED
    )
    torch.testing.assert_close(after_A + 3 * after_B, v_A + 3 * v_B)
    torch.testing.assert_close(after_B - after_A, torch.tensor([0.6 * 1.5, 1.5], dtype=torch.float64))


@pytest.mark.parametrize(
    ("bodies", "by_A", "by_B"),
    [(DetachBodies.NONE, 0.2, 0.8), (DetachBodies.ACTUATED, 1.0, 0.8), (DetachBodies.ALL, 1.0, 0.0)],
)
@pytest.mark.parametrize("speed", [2.0, 0.0])
def test_collision_detached_by_body(bodies: DetachBodies, by_A: float, by_B: float, speed: float) -> None:
    """dv_A/dv_A and dv_B/dv_A for equal masses and e = 0.6 are (1-e)/2 and (1+e)/2 whole; a detached body keeps 1, and
    0: what it receives is unknown. The same holds for bodies that only touch."""
    v_A = number(speed)
    none = torch.zeros((), dtype=torch.float64)
    after_A, after_B = collision(v_A, none, torch.tensor(True), e=0.6, mass_A=1.0, mass_B=1.0, bodies=bodies)
    assert slopes(after_A, v_A) + slopes(after_B, v_A) == pytest.approx([by_A, by_B])
    assert after_B.item() == pytest.approx(0.8 * speed)


@pytest.mark.parametrize("helper", [detach_geometry, detach_impulse])
def test_helpers_of_the_step(helper: Callable[[Tensor, bool], Tensor]) -> None:
    """The helpers change no value; switched on they stop the gradient, switched off they are the identity."""
    x = number(2.0)
    assert helper(x, False) is x
    assert helper(x, True).item() == 2.0
    assert not helper(x, True).requires_grad


def imported(name: str, folder: Path, found: set[str]) -> set[str]:
    """Names of the engine's files that a file of it is made of, itself included."""
    if name not in found and (folder / f"{name}.py").exists():
        found.add(name)
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("r2s2r_cli.engine."):
                imported(str(node.module).split(".")[2], folder, found)
    return found


def test_the_step_detaches_here_only() -> None:
    """No other file that the step is made of calls `detach`: what a derivative leaves out is read in one place."""
    folder = Path(module.__file__).parent
    physics = imported("step", folder, set())
    assert {"step", "contact", "detach"} <= physics
    calls = {
        name
        for name in physics
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text()))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "detach"
    }
    assert calls == {"detach"}
