"""What a gait is rewarded for, of what came of it; and rewards that users bring along."""

from __future__ import annotations

import importlib
import inspect
import sysconfig
import traceback
from collections.abc import Callable
from dataclasses import dataclass, fields
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np

import r2s2r_cli
from r2s2r_cli.errors import UsageError

_OURS = (str(Path(r2s2r_cli.__file__).parent), "<")
_LIBRARIES = tuple(sysconfig.get_path(key) for key in ("stdlib", "purelib", "platlib"))
ENTRY_POINTS = "r2s2r.rewards"
"""Group of entry points in which other packages offer rewards."""


@dataclass(frozen=True)
class Outcomes:
    """What came of gaits, one a row, in the frame of their start: x along the principal axis, y forward, z up.

    com: displacement of the centre of mass [m], (B, 3). turn: of the principal axis about the vertical [rad], counter-
    clockwise positive, (B,); more than half a turn only of a gait whose ends lie about that. element: symmetry that the
    robot has undergone, (B,). error: distance of the last pose from the rest pose [m], (B,). duration: [s], (B,).
    switched: cables that a target changes, summed, (B,).
    """

    com: np.ndarray
    turn: np.ndarray
    element: np.ndarray
    error: np.ndarray
    duration: np.ndarray
    switched: np.ndarray

    def __len__(self) -> int:
        return len(self.turn)

    def take(self, rows: np.ndarray) -> Outcomes:
        """The same for some rows."""
        return Outcomes(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


_ANOTHER = "--behaviour forward   # docs/guides/plan.md shows a function"
Reward = Callable[[Outcomes], np.ndarray]

BEHAVIOURS: dict[str, Reward] = {
    "forward": lambda outcome: outcome.com[:, 1],
    "backward": lambda outcome: -outcome.com[:, 1],
    "clockwise": lambda outcome: -outcome.turn,
    "counterclockwise": lambda outcome: outcome.turn,
}
"""The four of the paper, section "Developing Policies with Symmetry Reduction": [m] and [rad]."""


def joined(parts: list[Outcomes]) -> Outcomes:
    """Outcomes one after the other."""
    return Outcomes(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Outcomes)})


def reward_named(name: str) -> Reward:
    """A behaviour of the paper, an entry point of group `r2s2r.rewards`, or `package.module:function`.

    Raises UsageError for a name that leads nowhere, or to something that is no function.
    """
    return BEHAVIOURS[name] if name in BEHAVIOURS else _checked(name, _brought_along(name))


def try_out(reward: Reward) -> None:
    """Ask a reward about two gaits that might be, before any is searched. Raises UsageError where it gives none."""
    two = np.ones(2)
    reward(Outcomes(np.array([[0.02, 0.2, 0.0], [-0.05, -0.1, 0.01]]), np.array([0.1, -0.3]), np.zeros(2, dtype=int),
                    0.005 * two, 5.5 * two, 6 * np.ones(2, dtype=int)))  # fmt: skip


def source_of(name: str) -> Path | None:
    """The file that a reward which a user brings along was written in; None for those of the paper, and where Python
    does not know it. Raises as `reward_named`."""
    if name in BEHAVIOURS:
        return None
    try:
        found = inspect.getsourcefile(_brought_along(name))
    except TypeError:  # something that can be called, and has no code of its own
        return None
    return None if found is None else Path(found)


def _brought_along(name: str) -> Reward:
    found = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    module, colon, attribute = name.partition(":")
    try:
        if name in found:
            made = found[name].load()
        elif colon:
            made = getattr(importlib.import_module(module), attribute)
        else:
            raise UsageError(
                "there is no such behaviour", where="--behaviour",
                expected=" | ".join([*BEHAVIOURS, *found, "package.module:function"]), received=name,
                hint="r2s2r plan --behaviour forward",
            )  # fmt: skip
    except UsageError:
        raise
    except (ImportError, AttributeError) as error:
        raise UsageError("the reward cannot be loaded", where=f"--behaviour {name}", received=str(error),
                         expected="package.module:function that Python can import",
                         hint=_ANOTHER) from error  # fmt: skip
    except Exception as error:  # whatever code of the user's raises
        raise UsageError("the file of the reward fails when it is imported", where=_raised_at(error, name),
                         expected="a module that Python can import", received=_described(error),
                         hint=_ANOTHER) from error  # fmt: skip
    if not callable(made):
        raise UsageError("the reward is no function", where=f"--behaviour {name}", expected="a function of Outcomes",
                         received=type(made).__name__, hint=_ANOTHER)  # fmt: skip
    found_reward: Reward = made
    return found_reward


def _checked(name: str, function: Reward) -> Reward:
    where = f"--behaviour {name}"

    def reward(outcome: Outcomes) -> np.ndarray:
        wanted = f"{len(outcome)} finite numbers"
        try:
            given = function(outcome)
        except Exception as error:  # whatever code of the user's raises
            raise UsageError("the reward fails", where=_raised_at(error, name), expected=wanted,
                             received=_described(error), hint=_ANOTHER) from error  # fmt: skip
        try:
            value = np.asarray(given, dtype=float)
        except (TypeError, ValueError) as error:
            raise UsageError("the reward gives no numbers", where=where, expected=wanted,
                             received=type(given).__name__, hint=_ANOTHER) from error  # fmt: skip
        bad = int((~np.isfinite(value)).sum())
        if value.shape != (len(outcome),) or bad:
            received = f"shape {value.shape}" if value.shape != (len(outcome),) else f"{bad} that are not finite"
            raise UsageError("the reward gives no number for every gait", where=where, expected=wanted,
                             received=received, hint=_ANOTHER)  # fmt: skip
        return value

    return reward


def _raised_at(error: Exception, name: str) -> str:
    """File and line in which an error arose: the innermost that is not ours, and not a library's where any is not."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}, line {error.lineno}"
    frames = [one for one in traceback.extract_tb(error.__traceback__) if not one.filename.startswith(_OURS)]
    own = [one for one in frames if not one.filename.startswith(_LIBRARIES)] or frames
    return f"{own[-1].filename}, line {own[-1].lineno}" if own else f"--behaviour {name}"


def _described(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0]
