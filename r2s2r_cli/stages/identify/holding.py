"""What the training intervals do not show is held while the rest is fitted; an effect that they do not show is off.

Fits of an effect begin beside its off value, where each of its numbers does something. What the data say nothing of
must not stay there: the refined simulator would have an effect that nobody has seen. So it is held at the mean of its
prior, before the others are fitted, which go without it. Where a fit ends it is asked again, since a simulator that
errs by more than noise is told less by the same data; then it is made again without what it does not show. What an
effect is like (`Free.shape`) shows as far as the effect is there: that is asked at the end alone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TypeVar

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.conclude import Assured, concluded, known_before
from r2s2r_cli.stages.identify.found import Found, ParameterFound
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust

Look = Callable[[Task, Predictor], Identifiability]
"""What the training intervals say where a fit would begin, with the numbers of the task held; refuses none."""
Made = TypeVar("Made")


def holding(task: Task, predictor: Predictor) -> tuple[Task, Predictor, Identifiability]:
    """The task with those parameters held that its training intervals do not show, the predictor with them where they
    are held, and what the intervals show of all.

    Raises as `known_before`, and InputError where they show none at all.
    """
    before = known_before(task, predictor)
    frees = predictor.mapping.frees
    likely = set(effects_moving(frees, ())) - set(_unshown_before(before, frees, ()))
    task, predictor = held_at(task, predictor, [name for name in undetermined(before) if name not in likely])
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
    names = _unshown_before(before or (look or _looked)(task, predictor), frees, task.held)
    return held_at(task, predictor, names, look)


def held_at(task: Task, predictor: Predictor, names: Sequence[str], look: Look | None = None) -> tuple[Task, Predictor]:
    """Hold these as well, each at the mean of its prior; and what of an effect does nothing any more without them, as
    the place of a patch that is none."""
    while names:
        frees = tuple(
            replace(free, start=free.mean) if free.name in names else free for free in predictor.mapping.frees
        )
        off = any(free.name in names and free.off is not None for free in frees)
        task, predictor = replace(task, held=(*task.held, *names)), predictor.starting(frees)
        names = ()
        if off and effects_moving(frees, task.held):
            names = _unshown_before((look or _looked)(task, predictor), frees, task.held)
    return task, predictor


def fitted_to_shown(
    task: Task,
    predictor: Predictor,
    make: Callable[[Task, Predictor], Made],
    unknown: Callable[[Made], Collection[str]],
    *,
    kept: Kept | None = None,
    look: Look | None = None,
) -> tuple[Task, Made]:
    """What `make` makes, made again without what of effects its end does not show, until it shows all that moved.

    unknown: names of what was made that its end does not show. kept: its trace and checkpoint, which begin again with
    what is held by then: an interrupted fit takes that up there.
    """
    if kept is not None:
        names = [name for name in kept.saved.get("held", ()) if name not in task.held]
        task, predictor = held_at(task, predictor, names, look)
    while True:
        made = make(task, predictor)
        moving = effects_moving(predictor.mapping.frees, task.held)
        gone = unknown(made) if moving else ()
        names = [name for name in moving if name in gone]
        if not names:
            return task, made
        task, predictor = held_at(task, predictor, names, look)
        if kept is not None:
            kept.restart(held=list(task.held))


def concluded_to_shown(
    task: Task, predictor: Predictor, make: Callable[[Task, Predictor], Assured], kept: Kept, look: Look | None = None
) -> Found:
    """The same of a fit that says how sure its numbers are, judged. Raises what `concluded` raises."""
    task, known = fitted_to_shown(
        task, predictor, make, lambda made: not_identifiable(made.sure.parameters), kept=kept, look=look
    )
    return concluded(task, known.made.fit.problem.predictor, known)


def not_identifiable(parameters: Sequence[ParameterFound]) -> set[str]:
    """Names of those that are reported so."""
    return {one.free.name for one in parameters if one.trust is Trust.NOT_IDENTIFIABLE}


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


def _unshown_before(info: Identifiability, frees: Sequence[Free], held: Collection[str]) -> tuple[str, ...]:
    """Numbers of effects, not held yet, that are not shown where a fit begins; shapes where they do nothing at all."""
    unknown, moving = set(undetermined(info)), effects_moving(frees, held)
    shapes = {free.name for free in frees if free.shape}
    return tuple(name for name in moving if name in (info.no_effect if name in shapes else unknown))


def undetermined(info: Identifiability) -> tuple[str, ...]:
    """Names of those that this information does not determine."""
    both = zip(info.names, info.trust, strict=True)
    return tuple(name for name, trust in both if trust is Trust.NOT_IDENTIFIABLE)


def _looked(task: Task, predictor: Predictor) -> Identifiability:
    """By command replay, each interval from its own start."""
    return known_before(task, predictor, refuse=False)
