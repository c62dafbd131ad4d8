"""Billiards (the paper's appendix): which force on ball A brings ball B to its target in 500 steps?

The paper's rule: detach the contact response of the actuated ball A, never that of B, which moves by contact alone.
It leaves open everything else, so several readings of the problem are run; balls are points on a line. Readings
differ in the gap between the balls, in ground friction, and in how long the force acts. Detaching A takes away its
collision response and its ground friction, detaching B the same of B. The derivative that the whole graph gives misses
what the time of impact adds (the collision happens at a step); the table sets central differences beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor
from toy_fit import History, Rule, descend, figure, first, gradient_of, table

from r2s2r_cli.engine.detach import DetachBodies, collision, friction

STEPS, G, MASS, DT = 500, 9.81, 0.17, 0.01
TARGET = 1.0
"""How far B is to go [m]."""


@dataclass(frozen=True)
class Reading:
    """One reading of the problem. gap [m]; friction of A and B with the ground; push: steps; start: first force [N]."""

    name: str
    gap: float
    mu_A: float
    mu_B: float
    push: int
    start: float
    e: float = 0.9


READINGS = (
    Reading("struck", gap=0.2, mu_A=0.0, mu_B=0.0, push=50, start=0.04),
    Reading("pushed", gap=0.2, mu_A=0.0, mu_B=0.0, push=STEPS, start=0.005),
    Reading("pushed, e = 0", gap=0.2, mu_A=0.0, mu_B=0.0, push=STEPS, start=0.005, e=0.0),
    Reading("struck, friction", gap=0.2, mu_A=0.02, mu_B=0.02, push=50, start=0.2),
    Reading("touching, A held", gap=0.0, mu_A=0.02, mu_B=0.0, push=STEPS, start=0.02),
    Reading("touching, both held", gap=0.0, mu_A=0.02, mu_B=0.02, push=STEPS, start=0.02),
    Reading("apart, both held", gap=0.2, mu_A=0.02, mu_B=0.02, push=STEPS, start=0.02),
    Reading("struck, too weak", gap=0.2, mu_A=0.0, mu_B=0.0, push=50, start=0.01),
)
RULES = (Rule(3e-4), Rule(3e-3), Rule(0.001, adam=True), Rule(0.01, adam=True))
DRAWN, DRAWN_RULE = ("struck", "touching, A held"), RULES[2]


def position(force: Tensor, readings: Sequence[Reading], bodies: DetachBodies) -> Tensor:
    """How far B has come after 500 steps [m], (set-up,), for the force on A [N], (set-up,), and a reading a set-up."""

    def column(name: str) -> Tensor:
        return torch.tensor([getattr(reading, name) for reading in readings], dtype=force.dtype)

    gap, mu_A, mu_B, push, e = map(column, ("gap", "mu_A", "mu_B", "push", "e"))
    none = torch.zeros(len(readings), 1, dtype=force.dtype)
    x_A, v_A, x_B, v_B = none, none, none, none
    ground = {"normal": MASS * G, "mass": MASS, "dt": DT}
    for k in range(STEPS):
        pull = torch.where(k < push, force, 0.0).unsqueeze(-1)
        _, v_A = friction(x_A, v_A, pull, mu=mu_A, detach=bodies is not DetachBodies.NONE, **ground)
        _, v_B = friction(x_B, v_B, none, mu=mu_B, detach=bodies is DetachBodies.ALL, **ground)
        touch = gap.unsqueeze(-1) + x_B - x_A + (v_B - v_A) * DT <= 0
        v_A, v_B = collision(v_A, v_B, touch, e=e.unsqueeze(-1), mass_A=MASS, mass_B=MASS, bodies=bodies)
        x_A, x_B = x_A + v_A * DT, x_B + v_B * DT
    return x_B.squeeze(-1)


def secants(span: float = 0.05) -> Tensor:
    """Central differences [m/N] over a span of the force that averages over the step at which the balls meet."""
    force = torch.tensor([reading.start for reading in READINGS], dtype=torch.float64)
    low, high = (position(force * (1 + way * span), READINGS, DetachBodies.NONE) for way in (-1, 1))
    return (high - low) / (2 * span * force)


def gradients() -> str:
    """Table of d position of B / d F at the first force, for each choice of bodies, beside the secant."""
    at = torch.tensor([reading.start for reading in READINGS], dtype=torch.float64)
    found = [gradient_of(lambda f, b=bodies: position(f, READINGS, b), at) for bodies in DetachBodies]
    where, slopes, secant = found[0][0], [slope for _, slope in found], secants()
    rows = [
        [reading.name, float(where[k]), *(float(slope[k]) for slope in slopes), float(secant[k])]
        for k, reading in enumerate(READINGS)
    ]
    columns = ["reading", "B at [m]", *(f"detach {b}" for b in DetachBodies), "secant +-5 %"]
    return table("Billiards: d position of B / d F at the first force [m/N]", columns, rows)


def fit(bodies: DetachBodies, iterations: int) -> tuple[list[tuple[Reading, Rule]], History]:
    """All readings with all rules, (reading, rule) a set-up."""
    setups = [(reading, rule) for reading in READINGS for rule in RULES]
    readings, rules = zip(*setups, strict=True)
    start = torch.tensor([reading.start for reading in readings], dtype=torch.float64)
    done = descend(lambda f: (position(f, readings, bodies) - TARGET) ** 2, start, rules, iterations)
    return setups, done


def main(out: Path, iterations: int = 100) -> dict[DetachBodies, History]:
    """Print the tables, draw `billiards.png`."""
    print(gradients())
    setups: list[tuple[Reading, Rule]] = []
    done = {}
    for bodies in DetachBodies:
        setups, done[bodies] = fit(bodies, iterations)
    near = {bodies: first(h.loss < (0.05 * TARGET) ** 2) for bodies, h in done.items()}
    last = {bodies: h.loss[-1].sqrt() for bodies, h in done.items()}
    rows = [
        [reading.name, rule, *(text for b in DetachBodies for text in (near[b][k], float(last[b][k])))]
        for k, (reading, rule) in enumerate(setups)
    ]
    columns = ["reading", "rule", *(t for b in DetachBodies for t in (f"{b}: within 5 % at", "last error [m]"))]
    print(table(f"Billiards: {iterations} iterations", columns, rows))
    labelled = {f"detach {bodies}": history for bodies, history in done.items()}
    shown = [k for k, (reading, rule) in enumerate(setups) if reading.name in DRAWN and rule == DRAWN_RULE]
    rows_drawn = {f"{setups[k][0].name}, {DRAWN_RULE}": (labelled, k) for k in shown}
    figure(out / "billiards.png", rows_drawn, "force F [N]")
    return done
