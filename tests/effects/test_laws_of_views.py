"""The laws of sensors and camera against closed forms, and the frozen interface that diagnosis reads them by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect
from r2s2r_cli.effects.camera_delay import CameraDelay
from r2s2r_cli.effects.camera_pose import CameraPose
from r2s2r_cli.effects.camera_scale import CameraScale
from r2s2r_cli.effects.dropout import Dropout
from r2s2r_cli.effects.sensor_bias import SensorBias
from r2s2r_cli.effects.sensor_gain import ABOUT_M, SensorGain
from r2s2r_cli.engine import LatchedPid, Simulator, closed_loop, observe, sense, unseen
from tests.support.variants import Variant, pair, plugged


@pytest.fixture(scope="module")
def plain() -> Variant:
    """Two rods, three cables."""
    return pair(rod_contact=False)


def with_(plain: Variant, *effects: Effect, **values: float) -> Variant:
    """The variant with effects, numbers by their short names (all elements alike)."""
    made = plugged(plain, *effects, on=False)
    given = {name: torch.full_like(x, values[name.split(".")[1]]) for name, x in made.theta.extra.items()
             if name.split(".")[1] in values}  # fmt: skip
    return replace(made, theta=made.theta.with_values(given))


def seen(model: Variant, t: Tensor, p_WE: Tensor) -> Tensor:
    """What the camera makes of it."""
    return observe(model.structure, model.theta, t, p_WE)


def test_sensors_read_gain_then_bias_and_drift(plain: Variant) -> None:
    """In the order of the catalogue: bias and drift are of the sensor's input, the gain on how far that is from the
    middle of the travel."""
    model = with_(plain, SensorBias(), SensorGain(), bias_m=0.004, drift_m_per_s=1e-4, gain=1.05)
    length = torch.tensor([[0.1, 0.15, 0.2]], dtype=torch.float64)
    found = sense(model.structure, model.theta, length, 30.0)
    assert torch.allclose(found, ABOUT_M + 1.05 * (length + 0.004 + 0.003 - ABOUT_M), rtol=1e-14)
    t = torch.tensor([[0.0], [10.0]], dtype=torch.float64)
    many = sense(model.structure, model.theta, length.expand(2, -1), t)
    assert torch.allclose(many, ABOUT_M + 1.05 * (length + 0.004 + 1e-4 * t - ABOUT_M), rtol=1e-14)


def test_the_controller_acts_on_what_the_sensors_read(plain: Variant) -> None:
    """A sensor that reads 5 mm too much: lengths are recorded so, and the controller starts from them."""
    pid = LatchedPid(p=0.5, i=0.0, d=0.0, tolerance=0.02, min_length=0.1, range=0.1, period=0.01,
                     cable_caps=((1, 3), (0, 2), (1, 2)), actuated=(1,))  # fmt: skip
    none = plain.start.p_WB.new_zeros(1)
    runs = []
    for bias in (0.0, 0.005):
        model = with_(plain, SensorBias(), bias_m=bias)
        simulator = Simulator(model.structure, native=False)
        runs.append(closed_loop(simulator, model.theta, model.start, pid, none[:, None] + 0.99, none, none + 0.02))
    assert torch.allclose(runs[1].length[:, 0] - runs[0].length[:, 0], none + 0.005, rtol=0, atol=1e-15)
    assert not torch.equal(runs[0].u[:, 0], runs[1].u[:, 0])


def test_camera_pose_is_a_rigid_motion(plain: Variant) -> None:
    """Distances stay; turned about one axis by the right hand; a small tilt lifts what lies along x by -angle x."""
    generator = torch.Generator().manual_seed(0)
    p_WE = torch.randn(1, 3, 4, 3, generator=generator, dtype=torch.float64)
    t = torch.arange(3, dtype=torch.float64)
    whole = seen(with_(plain, CameraPose(), turn_x_rad=0.1, turn_y_rad=-0.05, turn_z_rad=0.15, shift_y_m=0.02), t, p_WE)
    for a, b in ((0, 1), (1, 3)):
        assert torch.allclose(
            (whole[:, :, a] - whole[:, :, b]).norm(dim=-1), (p_WE[:, :, a] - p_WE[:, :, b]).norm(dim=-1)
        )
    along = torch.zeros(1, 1, 1, 3, dtype=torch.float64)
    along[..., 0] = 1.0
    yawed = seen(with_(plain, CameraPose(), turn_z_rad=0.1, shift_x_m=0.01), t[:1], along)[0, 0, 0]
    assert yawed.numpy() == pytest.approx([np.cos(0.1) + 0.01, np.sin(0.1), 0.0], abs=1e-15)
    tilted = seen(with_(plain, CameraPose(), turn_y_rad=0.1), t[:1], along)[0, 0, 0]
    assert tilted.numpy() == pytest.approx([np.cos(0.1), 0.0, -np.sin(0.1)], abs=1e-15)


def test_what_was_seen_is_taken_back(plain: Variant) -> None:
    """Pose and scale together, and their inverse; without effects of the camera bit by bit what was given."""
    p_WE = torch.randn(1, 4, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    values = {"turn_x_rad": 0.05, "turn_z_rad": -0.1, "shift_x_m": 0.02, "factor": 1.03}
    model = with_(plain, CameraPose(), CameraScale(), CameraDelay(), Dropout(), **values)
    shown = seen(model, torch.zeros(1, dtype=torch.float64), p_WE[:, None])[:, 0]
    assert float((shown - p_WE).abs().max()) > 0.01
    assert torch.allclose(unseen(model.structure, model.theta, shown), p_WE, rtol=0, atol=1e-13)
    assert unseen(plain.structure, plain.theta, p_WE) is p_WE


@pytest.mark.parametrize("swapped", [0.1, 0.2, 0.3])
def test_the_camera_is_undone_whatever_the_tracker_mistakes(plain: Variant, swapped: float) -> None:
    """Caps that are taken for each other in the very frame that is asked about are no part of where the camera is."""
    p_WE = torch.randn(3, 4, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    now, turned = torch.zeros(1, dtype=torch.float64), {"turn_x_rad": 0.05, "shift_y_m": 0.02}
    shown = seen(with_(plain, CameraPose(), **turned), now, p_WE[:, None])[:, 0]
    model = with_(plain, CameraPose(), Dropout(), swapped=swapped, **turned)
    assert torch.allclose(unseen(model.structure, model.theta, shown), p_WE, rtol=0, atol=1e-13)


def test_camera_scale_stretches_rods(plain: Variant) -> None:
    """Rods are seen 2 % too long."""
    p_WE = torch.randn(1, 2, 4, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = seen(with_(plain, CameraScale(), factor=1.02), torch.arange(2).double(), p_WE)
    ratio = (found[:, :, 1] - found[:, :, 0]).norm(dim=-1) / (p_WE[:, :, 1] - p_WE[:, :, 0]).norm(dim=-1)
    assert torch.allclose(ratio, torch.full_like(ratio, 1.02), rtol=1e-13)


@pytest.mark.parametrize("tau", [0.013, 0.02, -0.017])
def test_camera_delay_shifts_a_ramp_by_exactly_tau(plain: Variant, tau: float) -> None:
    """A cap at constant speed is seen where it was tau earlier, and where it stands at the ends of the run; the
    derivative by the delay is minus the speed."""
    t = torch.linspace(0.0, 0.2, 21, dtype=torch.float64)
    p_WE = 0.3 * t[None, :, None, None] * torch.ones(1, 1, 4, 3, dtype=torch.float64)
    model = with_(plain, CameraDelay(), tau_s=tau)
    delay = model.theta.extra["camera_delay.tau_s"].clone().requires_grad_()
    found = CameraDelay().observation({"tau_s": delay}, t, p_WE)
    assert torch.allclose(found[0, :, 0, 0], 0.3 * torch.clamp(t - tau, 0.0, 0.2), rtol=0, atol=1e-12)
    assert torch.equal(found, seen(model, t, p_WE))
    (slope,) = torch.autograd.grad(found[0, 10, 0, 0], delay)
    assert float(slope) == pytest.approx(-0.3, rel=1e-9)


def test_dropout_loses_and_swaps_its_share(plain: Variant) -> None:
    """Of 20000 caps the share that is asked for, to three deviations; more of them at a higher rate, the same among
    them; swapped rods have their caps exchanged."""
    t = torch.arange(5000, dtype=torch.float64) * 0.0333
    p_WE = torch.randn(1, 5000, 4, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    few, many = (torch.isnan(seen(with_(plain, Dropout(), lost=rate), t, p_WE)[0, ..., 0]) for rate in (0.1, 0.2))
    for lost, rate in ((few, 0.1), (many, 0.2)):
        assert float(lost.double().mean()) == pytest.approx(rate, abs=3 * np.sqrt(rate * (1 - rate) / 20000))
    assert bool((many | ~few).all())
    alone = float((few[:, 0] & few[:, 1]).double().mean())
    assert alone == pytest.approx(0.01, abs=0.005)  # caps are lost independently of each other
    first = seen(with_(plain, Dropout(), lost=1e-6), torch.zeros(1, dtype=torch.float64), p_WE[:, :1])
    assert torch.equal(first, p_WE[:, :1])  # no cap is lost for certain in the frame at 0 s
    swapped = seen(with_(plain, Dropout(), swapped=0.1), t, p_WE)[0]
    other = p_WE[0].unflatten(1, (-1, 2)).flip(2).flatten(1, 2)
    moved = (swapped != p_WE[0]).all(-1)
    assert torch.equal(swapped[moved], other[moved])
    assert torch.equal(moved[:, 0], moved[:, 1])
    assert float(moved.double().mean()) == pytest.approx(0.1, abs=0.01)
