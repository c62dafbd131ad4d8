"""What the training intervals do not show is held while the rest is fitted; an effect that they do not show is off.

Fits of an effect begin beside its off value, where each of its numbers does something. What the data say nothing of
must not stay there: the refined simulator would have an effect that nobody has seen. So it is held at the mean of its
prior, before the others are fitted, which go without it. What a fit ends with is looked at again: where data are worse
explained than a fit hopes to begin with, they show less.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TypeVar

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.conclude import known_before
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.rounds import Fit
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust
from r2s2r_cli.stages.identify.trusted import known_after

Look = Callable[[Task, Predictor], Identifiability]
"""What the training intervals say at the starts of a predictor's numbers, with those of the task held; refuses none."""
Made = TypeVar("Made")


def holding(task: Task, predictor: Predictor) -> tuple[Task, Predictor, Identifiability]:
    """The task with those parameters held that its training intervals do not show, the predictor with them where they
    are held, and what the intervals show of all.

    Raises as `known_before`, and InputError where they show none at all.
    """
    before = known_before(task, predictor)
    held = tuple(name for name, trust in zip(before.names, before.trust, strict=True) if _unknown(trust))
    task, predictor = held_at(task, predictor, held)
    require_any(task.held, before.names)
    return task, predictor, before


def holding_effects(
    task: Task, predictor: Predictor, before: Identifiability | None = None, look: Look | None = None
) -> tuple[Task, Predictor]:
    """The same of effects alone, for methods that hold no other number. before: what the training intervals show, by
    `look` if it is not known yet."""
    frees = predictor.mapping.frees
    if not effects_moving(frees, task.held):
        return task, predictor
    names = unshown(before or (look or looked)(task, predictor), frees, task.held)
    return held_at(task, predictor, names, look)


def held_at(task: Task, predictor: Predictor, names: Sequence[str], look: Look | None = None) -> tuple[Task, Predictor]:
    """Hold these as well, each at the mean of its prior; and what of an effect shows no more without them, as the
    place of a patch that is none."""
    while names:
        frees = tuple(
            replace(free, start=free.mean) if free.name in names else free for free in predictor.mapping.frees
        )
        off = any(free.name in names and free.off is not None for free in frees)
        task, predictor = replace(task, held=(*task.held, *names)), predictor.starting(frees)
        left = off and effects_moving(frees, task.held)
        names = unshown((look or looked)(task, predictor), frees, task.held) if left else ()
    return task, predictor


def fitted_to_shown(
    task: Task,
    predictor: Predictor,
    make: Callable[[Task, Predictor], Made],
    fit_of: Callable[[Made], Fit],
    *,
    kept: Kept | None = None,
    look: Look | None = None,
) -> tuple[Task, Made]:
    """What `make` makes, made again without what of effects its end does not show, until it shows all that moved.

    fit_of: the fit of what was made. kept: its trace and checkpoint, which begin again with what is held by then: an
    interrupted fit takes that up there.
    """
    if kept is not None:
        names = tuple(name for name in kept.saved.get("held", ()) if name not in task.held)
        task, predictor = held_at(task, predictor, names, look)
    while True:
        made = make(task, predictor)
        fit = fit_of(made)
        frees = predictor.mapping.frees
        may = effects_moving(frees, task.held)
        names = unshown(known_after(fit, task.recipe.loss)[1], frees, task.held) if may else ()
        if not names:
            return task, made
        task, predictor = held_at(task, predictor, names, look)
        if kept is not None:
            kept.restart(held=list(task.held))


def looked(task: Task, predictor: Predictor) -> Identifiability:
    """By command replay, each interval from its own start."""
    return known_before(task, predictor, refuse=False)


def unshown(info: Identifiability, frees: Sequence[Free], held: Collection[str]) -> tuple[str, ...]:
    """Numbers of effects that the data do not show, but for those that are held already."""
    unknown = {name for name, trust in zip(info.names, info.trust, strict=True) if _unknown(trust)}
    return tuple(name for name in effects_moving(frees, held) if name in unknown)


def require_any(held: Collection[str], names: Sequence[str]) -> None:
    """Raises InputError where all of the names are held."""
    if held and len(held) == len(names):
        first = list(held)
        shown = ", ".join(first[:3]) + (f" and {len(first) - 3} more" if len(first) > 3 else "")
        raise InputError(
            "the training intervals show no parameter that is free: there is nothing to fit", where="--train",
            expected="intervals in which the robot moves as a free parameter says",
            received=f"none that shows {shown}", hint="r2s2r inspect 20-estimate.h5   # targets of each interval",
        )  # fmt: skip


def effects_moving(frees: Sequence[Free], held: Collection[str]) -> tuple[str, ...]:
    """Numbers of effects with a prior about off that are not held."""
    return tuple(free.name for free in frees if free.off is not None and free.name not in held)


def _unknown(trust: Trust) -> bool:
    return trust is Trust.NOT_IDENTIFIABLE
