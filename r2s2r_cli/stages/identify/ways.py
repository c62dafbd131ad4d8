"""Start states that were found already: a fit asks for the same ones again, and for more of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.data import RunData

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import State
    from r2s2r_cli.stages.identify.belief import Filter


@dataclass(frozen=True)
class Start:
    """Where an interval starts. state: a batch of 1; members: flat states (E, NS) that scatter about it as far as it is
    unknown, None where it is what robot.toml and the first frame say."""

    state: State
    members: Tensor | None = None


@dataclass(frozen=True)
class Way:
    """Starts of one run with parameter values (n,): `found` from interval 1 on, and those that are coming.

    What is asked for grows: of the first windows, of all intervals. None depends on a later frame, so what was found
    stays, and the filter goes on from there.
    """

    run: RunData
    values: np.ndarray
    belief: Filter
    coming: Iterator[Start]
    found: list[Start] = field(default_factory=list)

    def same(self, run: RunData, values: np.ndarray, belief: Filter) -> bool:
        """Whether these are the start states of that."""
        return self.run is run and np.array_equal(self.values, values) and self.belief == belief
