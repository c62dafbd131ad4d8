"""Probes in the engine: nothing at 0, exact derivatives, and planted numbers of our own engine recovered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import with_off_values
from r2s2r_cli.engine import Simulator, end_caps, pack_parameters, pack_state, step
from r2s2r_cli.engine.flat import unpack_state
from r2s2r_cli.stages.diagnose.where.probes import KINDS, Probe, ProbeModel
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.model import parameters_of
from tests.support.engine import threebar
from tests.support.robots import rested, subject


def _model() -> ProbeModel:
    """Of the threebar robot, with no effect beside the probes."""
    robot = nominal(threebar())
    model = Model(robot, effects=())
    return ProbeModel(robot, model, model.values0)


def test_probes_at_zero_are_not_there() -> None:
    """One step with all probes plugged in is that without, bit by bit; each probe alone changes it."""
    made = _model()
    plain = subject().structure
    start = replace(rested().state)
    theta = with_off_values(made.structure, parameters_of(threebar()))
    # Taut cables, turning winches, caps that slide (2 mm in the ground): every probe has something to act on.
    slide, down = (torch.tensor(one, dtype=torch.float64) for one in ([0.3, 0.1, 0.0], [0.0, 0.0, -0.002]))
    start = replace(start, p_WB=start.p_WB + down, v_WB=start.v_WB + slide, rest=start.rest - 5e-4)
    u, h = torch.ones(1, 6, dtype=torch.float64), torch.full((1, 1), 1e-3, dtype=torch.float64)
    before = step(plain, parameters_of(threebar()), start, u, h)
    after = step(made.structure, made.theta(np.zeros(len(made.names))), start, u, h)
    assert torch.equal(pack_state(plain, before), pack_state(made.structure, after))
    assert set(Probe().sizes(plain)) <= set(KINDS)
    for probe in Probe().sizes(plain):
        values = np.array([0.05 if name.startswith(f"{probe}.") else 0.0 for name in made.names])
        values *= {"height": 0.02, "force": 10.0, "weight": 4.0}.get(probe, 1.0)
        moved = step(made.structure, made.theta(values), start, u, h)
        assert not torch.equal(pack_state(plain, before), pack_state(made.structure, moved)), probe
    assert torch.isfinite(pack_parameters(made.structure, theta)).all()


def test_the_jacobian_of_the_probes_is_that_of_the_parameters() -> None:
    """Every probe is one number of the flat vector: differences of the vector are the Jacobian, exactly."""
    made = _model()
    x = 0.01 * np.random.default_rng(0).standard_normal(len(made.names))
    found = made.jacobian(x).numpy()
    zero = made.packed(np.zeros(len(made.names))).numpy()
    np.testing.assert_allclose(made.packed(x).numpy() - zero, found @ x, atol=1e-14)


@pytest.mark.slow
def test_tangents_are_central_differences_and_plants_come_out() -> None:
    """1.2 s of winding: tangents of winch rates, cable forces, weights and grips in machine code are central
    differences to 1e-4; a rate that is 8 per cent off and a tendon force of 0.15 N, planted in the engine, come back by
    ridge Gauss-Newton to 15 per cent of them (own engine: a check of the algorithm, no claim of accuracy)."""
    made = _model()
    simulator = Simulator(made.structure)
    n = len(made.names)
    u = np.zeros((1200, 6))
    u[100:900, [0, 3, 4]] = 1.0
    commands = torch.as_tensor(u)[None]
    start = rested().state

    def caps(values: np.ndarray) -> np.ndarray:
        run = simulator.rollout(made.theta(values), start, commands, step=1e-3, every=100)
        return run.end_caps().numpy()[0]

    def derivatives(values: np.ndarray) -> np.ndarray:
        theta = made.theta(values)
        run, tangents = simulator.jvp(theta, start, commands, d_parameters=made.jacobian(values), step=1e-3, every=100)
        flat = pack_state(made.structure, run.states, leading=2)[0]
        one = torch.func.jacfwd(lambda s: end_caps(theta, unpack_state(made.structure, s[None]))[0])
        return torch.einsum("fcis,fsd->fcid", torch.func.vmap(one)(flat), tangents[0]).numpy()

    zero = np.zeros(n)
    exact = derivatives(zero)
    size = 1e-5  # caps that begin to slip bend the response already at 1e-3
    for name in ("rate.0", "rate.3", "force.7", "weight.1", "grip.0"):
        k = made.names.index(name)
        axis = size * np.eye(n)[k]
        difference = (caps(axis) - caps(-axis)) / (2 * size)
        error = np.linalg.norm(difference - exact[..., k]) / np.linalg.norm(difference)
        assert error < 1e-4, (name, error)
    chosen = [k for k, name in enumerate(made.names) if name.split(".")[0] in ("rate", "force")]
    precision = np.array([KINDS[made.names[k].split(".")[0]].scale for k in chosen]) ** -2.0
    noise = 5e-4
    for name, planted in (("rate.3", 0.08), ("force.7", 0.15)):
        observed = caps(planted * np.eye(n)[made.names.index(name)])
        values = np.zeros(n)
        for _ in range(4):
            A = derivatives(values)[..., chosen].reshape(-1, len(chosen)) / noise
            y = (observed - caps(values)).ravel() / noise
            values[chosen] += np.linalg.solve(A.T @ A + np.diag(precision), A.T @ y - precision * values[chosen])
        size = values * np.array([KINDS[name.split(".")[0]].scale ** -1.0 for name in made.names])
        assert made.names[int(np.argmax(np.abs(size)))] == name
        assert abs(values[made.names.index(name)] - planted) < 0.15 * planted, (name, values[chosen])
