"""Start states that were found already: a fit asks for the same ones again, and for more of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.data import RunData

if TYPE_CHECKING:
    from r2s2r_cli.engine import State
    from r2s2r_cli.stages.identify.start import Filter


@dataclass(frozen=True)
class Way:
    """Start states of one run with parameter values (n,): `found` from interval 1 on, and those that are coming.

    What is asked for grows: of the first windows, of all intervals. None depends on a later frame, so what was found
    stays, and the filter goes on from there.
    """

    run: RunData
    values: np.ndarray
    belief: Filter
    coming: Iterator[State]
    found: list[State] = field(default_factory=list)

    def same(self, run: RunData, values: np.ndarray, belief: Filter) -> bool:
        """Whether these are the start states of that."""
        return self.run is run and np.array_equal(self.values, values) and self.belief == belief
