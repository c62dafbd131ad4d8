"""Drone lift-off (the paper's appendix): which thrust F brings a drone from the ground to 10 m at step 500?

While F < m g the drone stays down, so the loss does not know of F. With the contact response detached (Algorithm 1) the
gradient is that of a drone in flight, 2 (x - 10) n (n + 1) dt^2 / 2m, and leads out. The paper leaves open: mass, step,
restitution, first thrust, optimiser, and whether F is one number or one a step. They are swept.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor
from toy_fit import History, Rule, descend, figure, first, gradient_of, table

from r2s2r_cli.engine.detach import algorithm_1, algorithm_3, restitution, restitution_toi

FORMS = {
    "Algorithm 1 corrected": restitution,
    "Algorithm 1 printed": algorithm_1,
    "Algorithm 3 corrected": restitution_toi,
    "Algorithm 3 printed": algorithm_3,
}
TARGET, STEPS, G = 10.0, 500, 9.81
MASS, DT = 1.0, 0.01
STARTS = (0.0, 0.5, 0.9)
"""First thrust in weights."""
RULES = (Rule(1e-4), Rule(1e-3), Rule(0.1, adam=True), Rule(0.5, adam=True))


def height(force: Tensor, *, form: str, detach: bool, e: float = 0.0, mass: float = MASS, dt: float = DT) -> Tensor:
    """Height after 500 steps [m], (set-up,), under thrust [N] of shape (set-up,) or (500, set-up)."""
    x = v = torch.zeros(force.shape[-1], dtype=force.dtype)
    for k in range(STEPS):
        push = force[k] if force.dim() == 2 else force
        x, v = FORMS[form](x, v, push, e=e, mass=mass, gravity=G, dt=dt, detach=detach)
    return x


def gradients() -> str:
    """Table of d height / d F on the ground, against that of free flight."""
    rows = []
    for form in FORMS:
        for e in (0.0, 0.5):
            for mass, dt in ((1.0, 0.01), (0.5, 0.002)):
                at = torch.tensor([0.5 * mass * G], dtype=torch.float64)
                slope = [
                    gradient_of(
                        lambda f, d=d, e=e, m=mass, h=dt, a=form: height(f, form=a, detach=d, e=e, mass=m, dt=h), at
                    )
                    for d in (True, False)
                ]
                flight = STEPS * (STEPS + 1) / 2 * dt**2 / mass
                rows.append([form, e, mass, dt, *(float(s[1]) for s in slope), flight, float(slope[0][0])])
    columns = ["form", "e", "mass", "dt", "detached", "whole", "free flight", "height"]
    return table("Drone: d height / d F [m/N] and height [m] at F = m g / 2", columns, rows)


def fit(form: str, *, detach: bool, iterations: int) -> tuple[list[tuple[float, Rule]], History]:
    """All first thrusts with all rules, (start, rule) a set-up."""
    setups = [(start, rule) for start in STARTS for rule in RULES]
    force = torch.tensor([start * MASS * G for start, _ in setups], dtype=torch.float64)
    done = descend(
        lambda f: (height(f, form=form, detach=detach) - TARGET) ** 2, force, [r for _, r in setups], iterations
    )
    return setups, done


def fit_every_step(iterations: int) -> History:
    """The other reading, one thrust a step, detached, from half the weight, Adam 0.1; drawn by its mean thrust."""

    def loss(force: Tensor) -> Tensor:
        lost = (height(force.reshape(STEPS, 1), form="Algorithm 1 corrected", detach=True) - TARGET) ** 2
        return lost.expand(STEPS) / STEPS

    start = torch.full((STEPS,), 0.5 * MASS * G, dtype=torch.float64)
    done = descend(loss, start, [Rule(0.1, adam=True)] * STEPS, iterations)
    return History(*(x.sum(1, keepdim=True) for x in (done.loss, done.value / STEPS, done.gradient)))


def main(out: Path, iterations: int = 200) -> dict[str, History]:
    """Print the tables, draw `drone.png`."""
    print(gradients())
    rows, drawn = [], {}
    for form, detach in (
        ("Algorithm 1 corrected", True),
        ("Algorithm 1 corrected", False),
        ("Algorithm 1 printed", True),
        ("Algorithm 3 corrected", True),
    ):
        setups, done = fit(form, detach=detach, iterations=iterations)
        rows += report(f"{form}, {'detached' if detach else 'whole'}", [f"{s:g} mg, {r}" for s, r in setups], done)
        drawn[f"{form}, {'detached' if detach else 'whole'}"] = done
    each = fit_every_step(iterations)
    rows += report("Algorithm 1 corrected, detached", ["0.5 mg, one F a step, Adam 0.1"], each)
    columns = ["form", "start and rule", "lift-off at", "within 1 % at", "last |x - 10| [m]", "last F [N]"]
    print(table(f"Drone: {iterations} iterations", columns, rows))
    shown = RULES.index(Rule(0.1, adam=True))
    figure(out / "drone.png", {"drone, F from 0, Adam 0.1": (drawn, shown)}, "thrust F [N]")
    return drawn


def report(form: str, names: list[str], done: History) -> list[list[object]]:
    """Rows of the table of fits."""
    lifted, near = first(done.loss < 0.99 * TARGET**2), first(done.loss < (0.01 * TARGET) ** 2)
    last = done.loss[-1].sqrt()
    return [[form, n, lifted[k], near[k], float(last[k]), float(done.value[-1, k])] for k, n in enumerate(names)]
