"""The paper's drone, box and billiards: gradients in closed form, and who gets out of the contact and who does not."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from r2s2r_cli.engine.detach import DetachBodies
from tests.examples.load import load

toy_fit, drone, box, billiards = (load("02_detachment", name) for name in ("toy_fit", "drone", "box", "billiards"))


def slope(function: object, at: float) -> float:
    """Derivative of an element-wise function at one number."""
    return float(toy_fit.gradient_of(function, torch.tensor([at], dtype=torch.float64))[1])


@pytest.mark.parametrize("form", ["Algorithm 1 corrected", "Algorithm 3 corrected"])
def test_drone_gradient_on_the_ground(form: str) -> None:
    """Under half its weight, d height / dF is n(n+1)/2 dt^2/m detached, and exactly zero whole."""
    flight = 500 * 501 / 2 * drone.DT**2 / drone.MASS
    assert slope(lambda f: drone.height(f, form=form, detach=True), 5.0) == pytest.approx(flight)
    assert slope(lambda f: drone.height(f, form=form, detach=False), 5.0) == 0.0


def test_drone_reaches_its_target_only_detached() -> None:
    """From 0.9 of its weight the drone is within 1 % of 10 m after 8 updates; whole, or as printed, it never lifts."""
    force, rule = torch.tensor([0.9 * drone.G], dtype=torch.float64), [toy_fit.Rule(3e-3)]

    def last(form: str, detach: bool) -> float:
        done = toy_fit.descend(
            lambda f: (drone.height(f, form=form, detach=detach) - drone.TARGET) ** 2, force, rule, 8
        )
        return float(drone.height(done.value[-1], form=form, detach=detach))

    assert last("Algorithm 1 corrected", True) == pytest.approx(10.0, rel=0.01)
    assert last("Algorithm 1 corrected", False) == 0.0
    assert last("Algorithm 1 printed", True) == 0.0


def test_box_target_is_the_simulated_one() -> None:
    """The closed form of the target is where the simulated box of that friction ends."""
    mu, pull = torch.tensor([0.1, 0.25, 0.25], dtype=torch.float64), torch.tensor([3.0, 5.0, -5.0], dtype=torch.float64)
    simulated = box.position(mu, pull, printed=False, detach=True)
    closed = [box.target(float(m), float(p)) for m, p in zip(mu, pull, strict=True)]
    torch.testing.assert_close(simulated, torch.tensor(closed, dtype=torch.float64))


def test_box_finds_its_friction_only_detached() -> None:
    """From mu = 1, stuck, friction is found in 20 updates; whole, it does not move; printed and pulled to the left, it
    grows. From a mu that is too small the whole graph does as well."""
    done = {
        name: box.fit(printed=printed, detach=detach, iterations=20)
        for name, printed, detach in (("corrected", False, True), ("printed", True, True), ("whole", False, False))
    }
    for k, (pull, truth, start, rule) in enumerate(done["whole"][0]):
        if rule != toy_fit.Rule(1e-3):
            continue
        last = {name: float(history.value[-1, k]) for name, (_, history) in done.items()}
        assert last["corrected"] == pytest.approx(truth, abs=0.01)
        assert last["whole"] == (start if start == 1.0 else pytest.approx(truth, abs=0.01))
        if start == 1.0 and pull < 0:
            assert last["printed"] > 1.5


def test_billiards_gradients_by_body() -> None:
    """Detaching B leaves nothing anywhere. Detaching A changes nothing in a single collision, and alone keeps a
    gradient where A is held by friction and touches B. Where the balls never meet, nothing helps."""
    at = torch.tensor([reading.start for reading in billiards.READINGS], dtype=torch.float64)
    found = {
        bodies: toy_fit.gradient_of(lambda f, b=bodies: billiards.position(f, billiards.READINGS, b), at)[1]
        for bodies in DetachBodies
    }
    by = {
        reading.name: {bodies: float(slopes[k]) for bodies, slopes in found.items()}
        for k, reading in enumerate(billiards.READINGS)
    }
    assert all(slopes[DetachBodies.ALL] == 0.0 for slopes in by.values())
    for name in ("struck", "struck, friction"):
        assert by[name][DetachBodies.ACTUATED] == pytest.approx(by[name][DetachBodies.NONE])
        assert by[name][DetachBodies.NONE] > 0
    for name in ("touching, A held", "touching, both held"):
        assert by[name][DetachBodies.NONE] == 0.0
        assert by[name][DetachBodies.ACTUATED] > 0
    for name in ("apart, both held", "struck, too weak"):
        assert set(by[name].values()) == {0.0}


def test_billiards_whole_gradient_is_that_of_the_program() -> None:
    """Nothing detached, the gradient is the central difference of the same program (between two steps of impact), in
    readings where the balls part after they meet: with e = 0 they stay in touch, on the edge of a switch."""
    readings = [reading for reading in billiards.READINGS if reading.name in ("struck", "pushed", "struck, friction")]
    at = torch.tensor([reading.start for reading in readings], dtype=torch.float64)
    _, slopes = toy_fit.gradient_of(lambda f: billiards.position(f, readings, DetachBodies.NONE), at)
    low, high = (billiards.position(at * (1 + way), readings, DetachBodies.NONE) for way in (-1e-7, 1e-7))
    torch.testing.assert_close(slopes, (high - low) / (2e-7 * at), rtol=1e-5, atol=0)


@pytest.mark.slow
def test_billiards_held_ball_is_freed_by_detaching_it() -> None:
    """A held by friction, touching B: only with A alone detached does descent bring B within 5 % of its target."""
    reading = next(reading for reading in billiards.READINGS if reading.name == "touching, A held")
    start = torch.tensor([reading.start], dtype=torch.float64)
    near = {}
    for bodies in DetachBodies:
        done = toy_fit.descend(
            lambda f, b=bodies: (billiards.position(f, [reading], b) - billiards.TARGET) ** 2,
            start, [toy_fit.Rule(3e-4)], 10,
        )  # fmt: skip
        near[bodies] = float(done.loss[-1]) < (0.05 * billiards.TARGET) ** 2
    assert near == {DetachBodies.NONE: False, DetachBodies.ACTUATED: True, DetachBodies.ALL: False}


@pytest.mark.slow
@pytest.mark.parametrize(("toy", "picture"), [(drone, "drone.png"), (box, "box.png"), (billiards, "billiards.png")])
def test_each_toy_prints_and_draws(
    toy: object, picture: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A short run prints both tables and writes the paper's figure."""
    toy.main(tmp_path, iterations=2)
    assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert "2 iterations" in capsys.readouterr().out
