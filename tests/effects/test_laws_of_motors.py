"""The laws of the motors and cables against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.backlash import Backlash
from r2s2r_cli.effects.battery_sag import BatterySag
from r2s2r_cli.effects.command_latency import CommandLatency
from r2s2r_cli.effects.load_droop import LoadDroop
from r2s2r_cli.effects.motor_dead_zone import EDGE, MotorDeadZone
from r2s2r_cli.effects.motor_lag import MotorLag
from r2s2r_cli.effects.motor_speed_mismatch import MotorSpeedMismatch
from r2s2r_cli.effects.spool_buildup import SpoolBuildup
from r2s2r_cli.effects.tendon_relaxation import TendonRelaxation
from r2s2r_cli.effects.tendon_set import TendonSet
from r2s2r_cli.effects.tendon_stiffness import TendonStiffness
from r2s2r_cli.engine import LatchedPid, Simulator, closed_loop, read
from r2s2r_cli.engine.flat import parameter_slots, size, state_slots
from r2s2r_cli.engine.hooks import CableTerms, MotorTerms
from tests.support.variants import Variant, pair, plugged

H = 1e-3
SPEED = 0.06
"""[m/s] of the winch of the pair."""


def column(*values: float) -> Tensor:
    """Numbers (1, n)."""
    return torch.tensor([values], dtype=torch.float64)


def with_(plain: Variant, effect: object, **values: float | list[float]) -> Variant:
    """The variant with one effect at these values."""
    made = plugged(plain, effect, on=False)  # type: ignore[arg-type]
    given = {f"{effect.name}.{name}": torch.as_tensor(x, dtype=torch.float64).expand(  # type: ignore[attr-defined]
        made.theta.extra[f"{effect.name}.{name}"].shape) for name, x in values.items()}  # type: ignore[attr-defined] # fmt: skip
    return replace(made, theta=made.theta.with_values(given))


def wound(model: Variant, commands: Tensor) -> Tensor:
    """Cable drawn in after each step in torch, (row,) [m], of the pair held in the air without gravity."""
    theta = replace(model.theta, gravity=torch.zeros_like(model.theta.gravity))
    run = Simulator(model.structure, native=False).rollout(theta, model.start, commands, step=H, substeps=1)
    return (model.start.rest - run.states.rest)[0, 1:, 0]


@pytest.fixture(scope="module")
def plain() -> Variant:
    """Two rods, a winched and two passive cables, of which none is tense."""
    model = pair(rod_contact=False)
    return replace(
        model, theta=replace(model.theta, stiffness=model.theta.stiffness * 1e-9, damping=model.theta.damping * 0)
    )


def test_dead_zone() -> None:
    """Nothing below the threshold less its edge, everything above it, a line between; both ways alike."""
    u = column(0.3, 0.29, 0.28, 0.1, -0.29, -1.0)
    found, _ = MotorDeadZone().command({"threshold": torch.full_like(u, 0.3)}, {}, u, column(H))
    assert torch.allclose(found, column(0.3, 0.145, 0.0, 0.0, -0.145, -1.0), rtol=0, atol=1e-12)
    assert EDGE == 0.02


@pytest.mark.parametrize("tau", [0.0, 0.0073, 0.012])
def test_latency_shifts_a_ramp_by_exactly_tau(plain: Variant, tau: float) -> None:
    """A cable that is drawn in from 5 ms on is drawn in from 5 ms + tau on, between whole steps too."""
    model = with_(plain, CommandLatency(), tau_s=tau)
    commands = torch.zeros(1, 24, 1, dtype=torch.float64)
    commands[:, 5:] = 1.0
    t = H * torch.arange(1, 25, dtype=torch.float64)
    whole = t - 0.005 - tau >= H * 1.001
    assert torch.allclose(wound(model, commands)[whole], SPEED * (t - 0.005 - tau)[whole], rtol=0, atol=1e-14)
    assert float(wound(model, commands)[t <= 0.005 + tau].abs().max()) < 1e-14


@pytest.mark.slow
def test_the_derivative_by_the_latency(plain: Variant) -> None:
    """Of the cable's rest length while it is drawn in: the speed."""
    model = with_(plain, CommandLatency(), tau_s=0.0023)
    commands = torch.ones(1, 5, 1, dtype=torch.float64)
    p = torch.zeros(size(parameter_slots(model.structure)), 1, dtype=torch.float64)
    p[parameter_slots(model.structure)["command_latency.tau_s"].start] = 1.0
    _, tangents = Simulator(model.structure, native=False).jvp(
        model.theta, model.start, commands, d_parameters=p, step=H, substeps=1
    )
    by_delay = tangents[0, -1, state_slots(model.structure)["rest"].start, 0]
    assert float(by_delay) == pytest.approx(SPEED, rel=1e-9)


def test_latency_in_closed_loop(plain: Variant) -> None:
    """The controller's command moves the winch after the delay and not before."""
    pid = LatchedPid(p=6.0, i=0.0, d=0.0, tolerance=0.1, min_length=0.1, range=0.1, period=0.01,
                     cable_caps=((1, 3), (0, 2), (1, 2)), actuated=(1,))  # fmt: skip
    none = plain.start.p_WB.new_zeros(1)
    rests = []
    for tau in (0.0, 0.03):
        model = with_(plain, CommandLatency(), tau_s=tau)
        theta = replace(model.theta, gravity=torch.zeros_like(model.theta.gravity))
        simulator = Simulator(model.structure, native=False)
        out = closed_loop(simulator, theta, model.start, pid, none[:, None], none, none + 0.06)
        rests.append(model.start.rest[0, 0] - out.trajectory.states.rest[0, :, 0])
    assert torch.allclose(rests[1][3:], rests[0][: len(rests[1]) - 3], rtol=0, atol=1e-12)
    assert float(rests[1][3].abs()) < 1e-12
    assert float(rests[0][3]) > 1e-3


def test_lag_is_an_exponential(plain: Variant) -> None:
    """After a step of the command the winch reaches its speed as 1 - exp(-t / tau), to the order of the step."""
    tau = 0.03
    run = wound(with_(plain, MotorLag(), tau_s=tau), torch.ones(1, 30, 1, dtype=torch.float64))
    t = H * torch.arange(1, 31, dtype=torch.float64)
    speed = torch.diff(run, prepend=run.new_zeros(1)) / H
    assert float((speed / SPEED - (1 - torch.exp(-t / tau))).abs().max()) < H / tau


def test_speed_mismatch(plain: Variant) -> None:
    """A winch 20 % slow draws in 20 % less."""
    run = wound(with_(plain, MotorSpeedMismatch(), factor=0.8), torch.ones(1, 10, 1, dtype=torch.float64))
    assert float(run[-1]) == pytest.approx(0.8 * SPEED * 10 * H, rel=1e-12)


def test_battery_sag(plain: Variant) -> None:
    """Speed falls linearly with the charge drawn, by a jump with what pulls now, and a pause costs nothing."""
    fade, drop = 2.0, 0.1
    commands = torch.ones(1, 40, 1, dtype=torch.float64)
    commands[:, 20:30] = 0.0
    run = wound(with_(plain, BatterySag(), fade_per_s=fade, drop=drop), commands)
    speed = torch.diff(run, prepend=run.new_zeros(1)) / (SPEED * H)
    used = H * torch.cat([torch.arange(20), torch.arange(20, 30)]).to(speed)
    assert torch.allclose(speed[torch.arange(40) // 10 != 2], 1 - fade * used - drop, rtol=0, atol=1e-9)
    assert float(speed[20:30].abs().max()) == 0.0


def test_load_droop() -> None:
    """A tense winch draws in slower by b T, and pays out as fast as ever."""
    model = with_(pair(rod_contact=False), LoadDroop(), per_newton=0.02)
    start = replace(model.start, rest=read(model.structure, model.theta, model.start).length[:, [1]] - 0.004)
    tension = float(read(model.structure, model.theta, start).tension[0, 1])
    assert 1.0 < tension < 40.0
    for u, factor in ((1.0, 1 - 0.02 * tension), (-1.0, 1.0)):
        made = replace(model, start=start)
        run = wound(made, torch.full((1, 1, 1), u, dtype=torch.float64))
        assert float(run[0]) == pytest.approx(u * SPEED * H * factor, rel=1e-9)


def test_spool_buildup() -> None:
    """What is wound grows as s' = v (1 + c s): s = (exp(c v t) - 1) / c from a cable at its longest."""
    c, s = 3.0, 0.0
    for _ in range(200):
        load = replace(TERMS, wound=column(s))
        rate, _ = SpoolBuildup().motor({"per_metre": column(c)}, {}, column(SPEED), load, column(H))
        s += H * float(rate)
    assert s == pytest.approx((math.exp(c * SPEED * 0.2) - 1) / c, rel=1e-4)


def test_backlash() -> None:
    """Missing after a reversal is the play, whatever the step; after a short way back only what was taken up of it. A
    cable was let out before the first motion: that loses the play too, if it winds in."""
    effect, play, h = Backlash(), 0.0041, column(H)
    z = {"way": column(0.0), "travel": column(0.0)}
    moved, at = [], 0.0
    for rate, steps in ((0.05, 182), (-0.05, 100), (0.05, 40), (-0.05, 300), (0.05, 20)):
        for _ in range(steps):
            found, z = effect.motor({"play_m": column(play)}, z, column(rate), TERMS, h)  # type: ignore[assignment]
            at += H * float(found)
        moved.append(at)
    # 9.1 mm in, 4.1 of them play; 5 mm back, 4.1 of them play; 2 mm of play taken up; given back; less than the play.
    expected = [0.005, 0.005 - 0.0009, 0.0041, 0.0041 - (0.015 - 0.002), 0.0041 - 0.013]
    assert moved == pytest.approx(expected, abs=1e-12)
    z = {"way": column(0.0), "travel": column(0.0)}
    out, _ = effect.motor({"play_m": column(play)}, z, column(-0.05), TERMS, h)
    assert float(out) == -0.05


NOTHING = column(0.0)
TERMS = MotorTerms(NOTHING, NOTHING, NOTHING, NOTHING)


def test_tendon_stiffness() -> None:
    """The tension of a stretched cable is that of the factor, its neighbour's the same as before."""
    plain = pair(rod_contact=False)
    start = replace(plain.start, rest=plain.start.rest - 0.004)
    model = with_(plain, TendonStiffness(), factor=[1.0, 0.7, 1.0])
    before, now = read(plain.structure, plain.theta, start), read(model.structure, model.theta, start)
    assert float(before.tension[0, 1]) > 1.0
    assert torch.allclose(now.tension, before.tension * column(1.0, 0.7, 1.0), rtol=1e-12)


def test_relaxation_is_an_exponential() -> None:
    """A stretch that appears at once is held with its force, of which share (1 - exp(-t / tau)) is lost; a slack cable
    does not pull."""
    effect, x = TendonRelaxation(), {"share": column(0.4), "tau_s": column(0.05)}
    stretch, k, h = 0.003, 2000.0, column(1e-4)
    still = CableTerms(column(stretch), column(0.0), column(k * stretch), column(k), column(1.0))
    z = {"stretch": column(0.0)}
    rising = replace(still, rate=column(stretch / 1e-4))
    force, z = effect.cable(x, z, rising, h)  # type: ignore[assignment]
    found = [float(force)]
    for _ in range(1000):
        force, z = effect.cable(x, z, still, h)  # type: ignore[assignment]
        found.append(float(force))
    t = 1e-4 * torch.arange(1001, dtype=torch.float64)
    expected = k * stretch * (1 - 0.4 * (1 - torch.exp(-t / 0.05)))
    assert torch.allclose(torch.tensor(found, dtype=torch.float64), expected, rtol=2e-3)
    slack = replace(still, stretch=column(-0.001), rate=column(-9.0), force=column(0.0))
    force, z = effect.cable(x, {"stretch": column(-0.001)}, slack, h)  # type: ignore[assignment]
    assert float(force) == 0.0


def test_cords_do_not_relax(plain: Variant) -> None:
    """A branch that is stretched by 1 mm pulls on the tendons with its stiffness, on a winched cable not at all."""
    length = read(plain.structure, plain.theta, plain.start).length[0]
    theta = replace(plain.theta, rest=(length[[0, 2]] - 0.002)[None], damping=plain.theta.damping * 0)
    start = replace(plain.start, rest=length[[1]][None] - 0.002)
    model = with_(replace(plain, theta=theta, start=start), TendonRelaxation(), share=0.3, tau_s=30.0)
    stretched = replace(model.start, extra={"tendon_relaxation.stretch": column(1e-3, 1e-3, 1e-3)})
    now, relaxed = (read(model.structure, model.theta, one, h=1e-9).tension for one in (stretched, model.start))
    assert float(relaxed.min()) > 0.0
    assert torch.allclose(now - relaxed, 0.3e-3 * theta.stiffness * column(1.0, 0.0, 1.0), rtol=1e-6, atol=1e-9)


def test_set_makes_slack_cables_pull() -> None:
    """A cable that hangs through by 2 mm pulls with the stiffness times 3 mm when it has shrunk by 5 mm: an effect can
    make a cable taut that is slack without it."""
    plain = pair(rod_contact=False)
    length = read(plain.structure, plain.theta, plain.start).length[0]
    theta = replace(plain.theta, rest=(length[[0, 2]] + 0.002)[None], damping=plain.theta.damping * 0)
    plain = replace(plain, theta=theta, start=replace(plain.start, rest=length[[1]][None] + 0.002))
    assert float(read(plain.structure, plain.theta, plain.start).tension.abs().max()) == 0.0
    model = with_(plain, TendonSet(), shift_m=[-0.005, -0.005, 0.0])
    found = read(model.structure, model.theta, model.start).tension
    assert torch.allclose(found, 2000.0 * column(0.003, 0.003, 0.0), rtol=1e-9, atol=1e-9)
