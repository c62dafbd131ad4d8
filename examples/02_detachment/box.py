"""Box pull (the paper's appendix): which friction mu lets a box under a known force reach its target in 200 steps?

From mu = 1 the box is stuck and the loss does not know of mu. Detached (Algorithm 2) the derivative of its position is
-N n (n + 1) dt^2 / 2m along the pull, in stick as in slip, and leads out. The paper leaves open: mass, step, pull,
target, optimiser. They are swept, also from a mu that is too small (the paper: either works) and pulling to the left,
where Algorithm 2 as printed has the wrong sign.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor
from toy_fit import History, Rule, descend, figure, first, gradient_of, table

from r2s2r_cli.engine.detach import algorithm_2, friction

STEPS, G, MASS, DT = 200, 9.81, 1.0, 0.01
PULLS = (3.0, 5.0, -5.0)
"""Known pull [N]: the box slips below mu = 0.31 and 0.51."""
TRUTH = (0.1, 0.25)
"""Friction that made the target."""
STARTS = (1.0, 0.02)
RULES = (Rule(1e-4), Rule(1e-3), Rule(0.01, adam=True), Rule(0.1, adam=True))


def position(mu: Tensor, pull: Tensor, *, printed: bool, detach: bool, dt: float = DT) -> Tensor:
    """Position after 200 steps [m], (set-up,), for mu and pull [N] of shape (set-up,)."""
    x, v, force = torch.zeros_like(pull), torch.zeros_like(pull), pull
    law = algorithm_2
    if not printed:
        x, v, force, law = x.unsqueeze(-1), v.unsqueeze(-1), pull.unsqueeze(-1), friction
    for _ in range(STEPS):
        x, v = law(x, v, force, mu=mu, normal=MASS * G, mass=MASS, dt=dt, detach=detach)
    return x if printed else x.squeeze(-1)


def target(mu: float, pull: float) -> float:
    """Where the box of friction mu comes to: the closed form of the sum over the steps [m]."""
    slide = max(abs(pull) / MASS - mu * G, 0.0)
    return (slide if pull > 0 else -slide) * STEPS * (STEPS + 1) / 2 * DT**2


def gradients() -> str:
    """Table of d position / d mu while stuck (mu = 1) and while sliding (mu = 0.1)."""
    rows = []
    for pull in (5.0, -5.0):
        for mu in (1.0, 0.1):
            at, force = torch.tensor([mu], dtype=torch.float64), torch.tensor([pull], dtype=torch.float64)
            found = [
                gradient_of(lambda k, p=printed, d=detach, f=force: position(k, f, printed=p, detach=d), at)[1]
                for printed, detach in ((False, True), (True, True), (False, False))
            ]
            intended = -G * STEPS * (STEPS + 1) / 2 * DT**2 * (1 if pull > 0 else -1)
            rows.append([pull, mu, "stuck" if mu * MASS * G > abs(pull) else "slides", *map(float, found), intended])
    columns = ["pull [N]", "mu", "box", "corrected", "printed", "whole", "intended"]
    return table("Box: d position / d mu [m]", columns, rows)


def fit(*, printed: bool, detach: bool, iterations: int) -> tuple[list[tuple[float, float, float, Rule]], History]:
    """All set-ups (pull, true mu, first mu, rule)."""
    setups = [(p, t, s, r) for p in PULLS for t in TRUTH for s in STARTS for r in RULES]
    pull = torch.tensor([p for p, _, _, _ in setups], dtype=torch.float64)
    wanted = torch.tensor([target(t, p) for p, t, _, _ in setups], dtype=torch.float64)
    start = torch.tensor([s for _, _, s, _ in setups], dtype=torch.float64)
    done = descend(
        lambda mu: (position(mu, pull, printed=printed, detach=detach) - wanted) ** 2,
        start, [r for _, _, _, r in setups], iterations,
    )  # fmt: skip
    return setups, done


def main(out: Path, iterations: int = 300) -> dict[str, History]:
    """Print the tables, draw `box.png`."""
    print(gradients())
    variants = {"corrected, detached": (False, True), "printed, detached": (True, True), "whole": (False, False)}
    setups: list[tuple[float, float, float, Rule]] = []
    drawn, good = {}, {}
    for name, (printed, detach) in variants.items():
        setups, drawn[name] = fit(printed=printed, detach=detach, iterations=iterations)
        good[name] = first(
            torch.stack([(drawn[name].value[:, k] - s[1]).abs() < 0.01 for k, s in enumerate(setups)], 1)
        )
    rows = [
        [p, truth, start, rule, *(text for n in variants for text in (good[n][k], float(drawn[n].value[-1, k])))]
        for k, (p, truth, start, rule) in enumerate(setups)
    ]
    columns = [
        "pull [N]",
        "true mu",
        "from",
        "rule",
        *(t for n in variants for t in (f"{n}: within 0.01 at", "last mu")),
    ]
    print(table(f"Box: {iterations} iterations; first one within 0.01 of the true mu, and the last mu", columns, rows))
    shown = {
        f"pulled to the {way}, mu from 1, Adam 0.01": (drawn, setups.index((pull, 0.25, 1.0, Rule(0.01, adam=True))))
        for way, pull in (("right", 5.0), ("left", -5.0))
    }
    figure(out / "box.png", shown, "friction mu")
    return drawn
