"""The trace of a fit, and its checkpoint, which holds the trace as well: taken up again, a fit leaves the same."""

from __future__ import annotations

from typing import Any

from r2s2r_cli.stages.checkpoint import Values
from r2s2r_cli.stages.identify.found import TraceStep


class Kept:
    """Steps of the trace so far, and what a checkpoint of this request had when the work began.

    steps: as `Found.trace`; a step is saved without its values. saved: of the interrupted work, {} where there was
    none. A fit holds what belongs to its next checkpoint, and saves it with the step that it has just made, so that no
    step is in one and not in the other. Steps after that belong to work that is done again: they wait for the next.
    held: whether something waits to be saved.
    """

    def __init__(self, checkpoint: Values | None) -> None:
        self._checkpoint = checkpoint
        self.saved: dict[str, Any] = (checkpoint.load() if checkpoint is not None else None) or {}
        self.steps = [TraceStep(*row) for row in self.saved.get("trace", ())]
        self._values = dict(self.saved)
        self.held = False

    def hold(self, **values: Any) -> None:
        """JSON values for the next save; those of other names stay as they are."""
        self._values.update(values)
        self.held = True

    def restart(self, **values: Any) -> None:
        """What was done so far is done again in another way: its trace and what was saved of it are forgotten, and
        `values` are held for the next save."""
        self.saved, self._values = {}, {}
        self.steps.clear()
        self.hold(**values)

    def save(self, **values: Any) -> None:
        """Replace what was saved. Raises what the checkpoint raises."""
        self.hold(**values)
        if self._checkpoint is not None:
            self._checkpoint.save(self._values)
        self.held = False

    def save_with_trace(self, **values: Any) -> None:
        """The same, with all steps of the trace so far."""
        rows = [[step.start, step.stage, step.iteration, step.cost] for step in self.steps]
        self.save(trace=rows, **values)
