"""What the three toys share: gradient descent over many set-ups at once, tables, and the paper's three-panel figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8
"""Adam's usual constants."""


@dataclass(frozen=True)
class Rule:
    """How a gradient becomes a step: plain descent, or Adam, with its learning rate."""

    rate: float
    adam: bool = False

    def __str__(self) -> str:
        return f"{'Adam' if self.adam else 'descent'} {self.rate:g}"


@dataclass(frozen=True)
class History:
    """Loss, parameter and gradient before every update, each (iteration, set-up)."""

    loss: Tensor
    value: Tensor
    gradient: Tensor


def descend(loss: Callable[[Tensor], Tensor], start: Tensor, rules: Sequence[Rule], iterations: int) -> History:
    """Minimise `loss`, (set-up,) -> (set-up,), from `start`: independent set-ups, each with a rule of its own."""
    rate = torch.tensor([rule.rate for rule in rules], dtype=start.dtype)
    adam = torch.tensor([rule.adam for rule in rules])
    value, mean, square = start.clone(), torch.zeros_like(start), torch.zeros_like(start)
    rows = []
    for k in range(1, iterations + 1):
        lost, gradient = gradient_of(loss, value)
        rows.append(torch.stack([lost, value, gradient]))
        mean = BETA_1 * mean + (1 - BETA_1) * gradient
        square = BETA_2 * square + (1 - BETA_2) * gradient**2
        step = (mean / (1 - BETA_1**k)) / ((square / (1 - BETA_2**k)).sqrt() + EPSILON)
        value = value - rate * torch.where(adam, step, gradient)
    return History(*torch.stack(rows).unbind(1))


def gradient_of(function: Callable[[Tensor], Tensor], at: Tensor) -> tuple[Tensor, Tensor]:
    """Value and derivative of an element-wise function; zero where no graph leads back to the input."""
    x = at.clone().requires_grad_()
    y = function(x)
    if not y.requires_grad:
        return y, torch.zeros_like(at)
    (slope,) = torch.autograd.grad(y.sum(), x, allow_unused=True)
    return y.detach(), torch.zeros_like(at) if slope is None else slope


def first(condition: Tensor) -> list[str]:
    """Number of the first iteration at which each set-up meets the condition (iteration, set-up), or a dash."""
    numbers = torch.where(condition.any(0), condition.int().argmax(0), torch.tensor(-1))
    return ["-" if n < 0 else str(int(n)) for n in numbers]


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A plain table with aligned columns."""
    cells = [list(columns), *[[f"{x:.4g}" if isinstance(x, float) else str(x) for x in row] for row in rows]]
    width = [max(len(row[k]) for row in cells) for k in range(len(columns))]
    lines = ["  ".join(text.ljust(width[k]) for k, text in enumerate(row)).rstrip() for row in cells]
    return "\n".join([title, "-" * max(len(title), sum(width) + 2 * len(width) - 2), *lines, ""])


def figure(path: Path, rows: Mapping[str, tuple[Mapping[str, History], int]], parameter: str) -> None:
    """The paper's figure: loss, parameter and gradient over the iterations.

    rows: title of a row of panels -> (histories by label, one line each; which of their set-ups is drawn).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(10, 2.4 * len(rows) + 0.5), dpi=75, layout="constrained")
    FigureCanvasAgg(sheet)
    axes: Any = sheet.subplots(len(rows), 3, squeeze=False)
    for row, (title, (histories, setup)) in enumerate(rows.items()):
        for number, (label, history) in enumerate(histories.items()):
            # Equal curves lie on top of each other: later ones are thinner and dashed, so that all are seen.
            line = {"label": label, "linestyle": ["-", "--", ":", "-."][number % 4], "linewidth": 3 - 0.6 * number}
            for column, series in enumerate((history.loss, history.value, history.gradient)):
                axes[row][column].plot(series[:, setup].numpy(), **line)
        for column, name in enumerate(("loss [m²]", parameter, "gradient of the loss")):
            axes[row][column].set(ylabel=name, xlabel="iteration")
        axes[row][0].set_title(title, fontsize=10, loc="left")
    handles, labels = axes[0][0].get_legend_handles_labels()
    sheet.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, metadata={"Software": None})
