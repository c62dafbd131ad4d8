"""The paper's identification: Adam on the Key Frame Loss (or a rival), the closed loop simulated anew each time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.errors import InputError, NumericalError
from r2s2r_cli.stages.identify.free import Mapping as Numbers
from r2s2r_cli.stages.identify.paper.demonstration import Demonstration
from r2s2r_cli.stages.identify.paper.flight import Flight, World, fly, replay
from r2s2r_cli.stages.identify.paper.losses import Loss, Norm
from r2s2r_cli.stages.identify.paper.shooting import compare

if TYPE_CHECKING:
    import torch

    from r2s2r_cli.engine import Parameters, State


@dataclass(frozen=True)
class Settings:
    """The paper's preset. rate: Adam's, in the units of the numbers. windows: of multiple shooting. closed_loop: the
    controller runs inside the simulation; False: recorded commands are replayed. attached: None, as the loss has it.
    held: numbers that stay where they start."""

    loss: Loss = Loss.KEY_FRAME
    iterations: int = 60
    rate: float = 0.1
    mask: bool = True
    windows: int = 4
    closed_loop: bool = True
    attached: bool | None = None
    norm: Norm = Norm.SQUARED
    held: tuple[str, ...] = ()


@dataclass(frozen=True)
class Trace:
    """What happened, before every update. values, gradients: (iteration, n). losses: that were differentiated; whole:
    over all windows, kept or not ([m^2] or [m] as the norm says); kept: share of the segments that the mask left; each
    (iteration,)."""

    values: np.ndarray
    gradients: np.ndarray
    losses: np.ndarray
    whole: np.ndarray
    kept: np.ndarray


@dataclass(frozen=True)
class PaperFit:
    """names, units as in `Numbers.frees`. last: after the last update; best: of the smallest loss over all segments
    (the mask changes from one iteration to the next, so masked losses do not compare); each (n,). words: of the last
    mask, one a run."""

    names: tuple[str, ...]
    last: np.ndarray
    best: np.ndarray
    trace: Trace
    words: tuple[str, ...]


@dataclass
class _Memory:
    """What Adam remembers, as JSON values; a resumed fit goes on bit by bit."""

    values: list[float]
    first: list[float]
    second: list[float]
    rows: list[dict[str, Any]] = field(default_factory=list)


def identify_paper(
    world: World,
    numbers: Numbers,
    demos: Sequence[Demonstration],
    starts: Sequence[State],
    settings: Settings | None = None,
    *,
    progress: Callable[[int, float], None] = lambda iteration, loss: None,
    save: Callable[[Mapping[str, Any]], None] = lambda values: None,
    resume: Mapping[str, Any] | None = None,
) -> PaperFit:
    """Adam with the paper's rate from the starts of `numbers`; each run is simulated from its state in `starts`.

    After an update numbers are brought back within their bounds. progress: called with the iteration (from 1) and its
    loss. save: called after every iteration with JSON values; given back as `resume`, the sequence goes on as if it had
    not been interrupted. Raises InputError where there is nothing to compare, NumericalError where the simulation, the
    loss or its derivative is not finite.
    """
    import torch

    chosen = settings or Settings()
    frees = numbers.frees
    if not demos or not frees:
        raise InputError(
            "nothing to identify", where="identify --method paper", expected="a run and a free parameter",
            received=f"{len(demos)} runs, {len(frees)} parameters", hint="r2s2r identify --method paper",
        )  # fmt: skip
    lower, upper = (
        torch.tensor([getattr(free, side) for free in frees], dtype=torch.float64) for side in ("lower", "upper")
    )
    memory = _Memory([free.start for free in frees], [0.0] * len(frees), [0.0] * len(frees))
    if resume is not None:
        memory = _Memory(**{name: list(resume[name]) for name in ("values", "first", "second", "rows")})
    x = torch.tensor(memory.values, dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([x], lr=chosen.rate)
    _restore(adam, x, memory)
    words: tuple[str, ...] = ()
    for iteration in range(len(memory.rows) + 1, chosen.iterations + 1):
        adam.zero_grad()
        row, words = _evaluate(world, numbers, demos, starts, chosen, x, iteration)
        adam.step()
        with torch.no_grad():
            x.clamp_(lower, upper)
        state = adam.state[x]
        memory = _Memory(x.tolist(), state["exp_avg"].tolist(), state["exp_avg_sq"].tolist(), [*memory.rows, row])
        save(vars(memory))
        progress(iteration, row["loss"])
    trace = _trace(memory.rows, len(frees))
    best = trace.values[int(np.argmin(trace.whole))] if len(trace.whole) else np.array(memory.values)
    return PaperFit(tuple(free.name for free in frees), np.array(memory.values), best, trace, words)


def simulated(
    world: World, theta: Parameters, demo: Demonstration, start: State, *, closed_loop: bool = True
) -> Flight:
    """The simulation of a demonstration: its targets in closed loop, or its commands. Raises the engine's errors."""
    plain = theta.map(lambda x: x.detach())
    if closed_loop:
        return fly(world, plain, start, demo.targets)
    return replay(world, plain, start, demo.t_command, demo.control, float(demo.t[-1]))


def _evaluate(
    world: World, numbers: Numbers, demos: Sequence[Demonstration], starts: Sequence[State], settings: Settings,
    x: torch.Tensor, iteration: int,
) -> tuple[dict[str, Any], tuple[str, ...]]:  # fmt: skip
    """Mean loss over the runs, its gradient into x.grad, and the row of the trace."""
    from r2s2r_cli.engine import EngineError

    total, whole, kept, words = 0.0, [], [], []
    values = x.tolist()
    for demo, start in zip(demos, starts, strict=True):
        theta = numbers.theta(x)
        try:
            flight = simulated(world, theta, demo, start, closed_loop=settings.closed_loop)
            found = compare(settings.loss, world, theta, flight, demo, mask=settings.mask, windows=settings.windows,
                            attached=settings.attached, norm=settings.norm)  # fmt: skip
        except EngineError as error:
            raise _failed(numbers, values, iteration, str(error)) from error
        (found.value.total / len(demos)).backward()
        total += found.value.total.item() / len(demos)
        whole.append(found.value.parts.mean().item())
        kept.append(found.value.kept.mean())
        words.append(f"{demo.name}: {found.mask.words}" if found.mask else f"{demo.name}: no mask")
    if x.grad is not None:
        x.grad[[k for k, name in enumerate(numbers.names) if name in settings.held]] = 0.0
    gradient = [0.0] * len(values) if x.grad is None else x.grad.tolist()
    if not np.isfinite([total, *gradient]).all():
        raise _failed(numbers, values, iteration, f"loss {total:g}, derivative {', '.join(f'{g:g}' for g in gradient)}")
    shares = {"whole": float(np.mean(whole)), "kept": float(np.mean(kept))}
    return {"values": values, "gradient": gradient, "loss": total, **shares}, tuple(words)


def _failed(numbers: Numbers, values: Sequence[float], iteration: int, received: str) -> NumericalError:
    at = ", ".join(f"{free.name} {value:g}" for free, value in zip(numbers.frees, values, strict=True))
    return NumericalError(
        "the fit left the finite numbers", where=f"iteration {iteration}, {at}", expected="finite numbers",
        received=received, hint="r2s2r identify   # the default method bounds its steps",
    )  # fmt: skip


def _restore(adam: torch.optim.Adam, x: torch.Tensor, memory: _Memory) -> None:
    """Give Adam what it remembered."""
    import torch

    if memory.rows:
        moments = {"exp_avg": memory.first, "exp_avg_sq": memory.second}
        adam.state[x] = {
            "step": torch.tensor(float(len(memory.rows))),
            **{name: torch.tensor(kept, dtype=torch.float64) for name, kept in moments.items()},
        }


def _trace(rows: Sequence[Mapping[str, Any]], n: int) -> Trace:
    return Trace(
        values=np.array([row["values"] for row in rows]).reshape(-1, n),
        gradients=np.array([row["gradient"] for row in rows]).reshape(-1, n),
        losses=np.array([row["loss"] for row in rows]), whole=np.array([row["whole"] for row in rows]),
        kept=np.array([row["kept"] for row in rows]),
    )  # fmt: skip
