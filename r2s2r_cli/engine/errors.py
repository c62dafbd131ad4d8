"""What the engine raises. It knows no command line: callers translate these into their own words and exit codes."""

from __future__ import annotations


class EngineError(Exception):
    """Base of the engine's errors."""


class EngineInputError(EngineError, ValueError):
    """An input that no robot can have, or of the wrong shape; `field` names it as in Parameters, State or Structure."""

    def __init__(self, field: str, what: str, *, expected: str, received: str) -> None:
        self.field, self.what, self.expected, self.received = field, what, expected, received
        super().__init__(f"{field}: {what} (expected {expected}, received {received})")


class NonFiniteError(EngineError, ArithmeticError):
    """The simulation left the finite numbers.

    step: number of the engine step that did it, from 0. environment: its number in the batch. body: `rod 1` or
    `cable 3`. term: the first quantity of the step that was not finite.
    """

    def __init__(self, *, step: int, time: float, environment: int, body: str, term: str) -> None:
        self.step, self.time, self.environment, self.body, self.term = step, time, environment, body, term
        super().__init__(
            f"the simulation left the finite numbers: step {step} ({time:g} s), environment {environment}, {body}, "
            f"{term}"
        )
