"""The laws of the rig's motors, winches and battery against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.rig.effects.battery import BatterySag
from r2s2r_cli.rig.effects.motors import CommandLatency, LoadDroop, MotorDeadZone, MotorLag
from r2s2r_cli.rig.effects.winches import Backlash, SpoolBuildup
from tests.support.rig_laws import DT, NONE, SCENE


def test_dead_zone_has_hysteresis() -> None:
    """A motor starts at the upper threshold and stops at the lower one."""
    law = MotorDeadZone(start=0.2, keep=0.1).law(SCENE)
    seen = [float(law.command(0.0, np.full(6, u))[0]) for u in (0.15, 0.2, 0.15, 0.1, 0.09, 0.15, -0.19, -0.2)]
    assert seen == [0.0, 0.2, 0.15, 0.1, 0.0, 0.0, 0.0, -0.2]


def test_latency_shifts_and_keeps_the_order() -> None:
    """Without jitter every change comes exactly that much later; with it none overtakes another."""
    law = CommandLatency(delay_s=0.1).law(SCENE)
    out = [float(law.command(k * 0.01, np.full(6, float(k // 7)))[0]) for k in range(60)]
    assert out[10:] == [float(k // 7) for k in range(50)]
    law = CommandLatency(delay_s=0.02, jitter_s=0.05).law(SCENE)
    late = [float(law.command(k * 0.01, np.full(6, float(k)))[0]) for k in range(200)]
    assert (np.diff(late) >= 0).all()
    assert np.mean(np.arange(50, 200) - late[50:]) > 7


def test_lag_is_the_exact_exponential() -> None:
    """After one time constant a step has come to 1 - 1/e, whatever the step of time; it stops with its own."""
    for n in (1, 10, 100):
        law = MotorLag(start_s=0.2, stop_s=0.05).law(SCENE)
        for _ in range(n):
            w = law.turn(0.2 / n, np.full(6, 10.0), NONE)
        np.testing.assert_allclose(w, 10 * (1 - np.exp(-1)), rtol=1e-12)
        np.testing.assert_allclose(law.turn(0.05, NONE, NONE), w * np.exp(-1), rtol=1e-12)


def test_droop_stalls_at_its_tension() -> None:
    """Half the stall tension is half the speed, the stall tension is none; letting out, it helps."""
    law = LoadDroop(stall_n=20.0, help_share=0.3).law(SCENE)
    tension = np.array([0.0, 10.0, 20.0, 30.0, 10.0, 10.0])
    w = law.turn(DT, np.array([5.0, 5.0, 5.0, 5.0, -5.0, 0.0]), tension)
    np.testing.assert_allclose(w, [5.0, 2.5, 0.0, 0.0, -5.75, 0.0])


def test_battery_falls_with_the_square_of_the_charge() -> None:
    """Half the charge gone costs a quarter of the fall, all of it all, and never more."""
    law = BatterySag(motor_s=10.0, fall=0.4, per_motor=0.0).law(SCENE)
    one = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert law.volts(5.0, 1.0, one) == pytest.approx(1 - 0.4 / 4)
    assert law.volts(5.0, 1.0, one) == pytest.approx(0.6)
    assert law.volts(50.0, 1.0, one) == pytest.approx(0.6)


def test_a_spool_grows_by_one_layer_a_layer() -> None:
    """After n full layers the radius is n layers larger, and it never falls while the spool winds."""
    law = SpoolBuildup(layer_m=0.0005, wraps=2.0).law(SCENE)
    angles = np.linspace(0, 8 * 2 * np.pi, 801)
    r = np.array([law.radius(np.full(6, a), SCENE.r)[0] for a in angles])
    np.testing.assert_allclose(r[[0, 200, 400, 600, 800]] - 0.0035, 0.0005 * np.arange(5), atol=1e-12)
    assert (np.diff(r) >= -1e-15).all()


def test_backlash_loses_its_play_at_every_reversal() -> None:
    """Winding in and out by more than the play moves the cable by that much less, and out again it comes back."""
    law = Backlash(play_m=0.006, soft_share=0.0).law(SCENE)
    way = np.concatenate([np.linspace(0.2, 0.15, 500), np.linspace(0.15, 0.2, 500)])
    out = np.array([law.rest(DT, np.full(6, rest), NONE)[0] for rest in way])
    assert out[0] == pytest.approx(0.2)
    assert out[499] == pytest.approx(0.15 + 0.006, abs=2e-4)
    assert out[-1] == pytest.approx(0.2, abs=2e-4)
    soft = Backlash(play_m=0.006, soft_share=1.0).law(SCENE)
    smooth = np.array([soft.rest(DT, np.full(6, rest), NONE)[0] for rest in way])
    assert np.abs(np.diff(smooth, n=2))[:498].max() < np.abs(np.diff(out, n=2))[:498].max() / 3
