"""Into how many engine steps a step is divided, so that stiff cables stay stable, without asking at every start.

What a start asks for (`engine.reading.longest_step`) takes a third of what its simulation does, and starts of one
stretch are millimetres apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, Structure

ROOM = 0.85
"""Of a step that is stable in one pose: so much is left for poses and robots near it. Of 4,800 robots and poses within
what is thought possible, about 41 poses, none needs less than 0.896."""


class Stable:
    """Steps [s] that are stable about poses that are known by a name. nominal: the robot that others are near to."""

    def __init__(self, structure: Structure, nominal: Parameters) -> None:
        from r2s2r_cli.engine.reading import always_stable_step

        self.structure, self.nominal = structure, nominal
        self._always = always_stable_step(structure, nominal)
        self._longest: dict[object, float] = {}

    def learn(self, name: object, start: Tensor) -> None:
        """A pose, (NS,); what is known by its name stays."""
        from r2s2r_cli.engine.flat import unpack_state
        from r2s2r_cli.engine.reading import longest_step

        if name not in self._longest:
            self._longest[name] = longest_step(self.structure, self.nominal, unpack_state(self.structure, start[None]))

    def step(self, names: set[object], theta: Parameters) -> float:
        """Stable for robots theta (batch k) near these poses: as their bound that holds in every pose says, or that of
        the nominal one there, as much shorter as the bound is. 0 where there is no such bound."""
        from r2s2r_cli.engine.reading import always_stable_step

        if not self._always > 0:
            return 0.0
        always = always_stable_step(self.structure, theta)
        return max(always, ROOM * (always / self._always) * min(self._longest[name] for name in names))
