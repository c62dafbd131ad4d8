"""Which artifacts a stage would read now, asked for as it was: those named then, and by default what is there today."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import Provenance


def joined(project: Project, iteration: Iteration | None, made: Provenance) -> list[str]:
    """Why it is stale for that: of every input that `unread` finds, one sentence."""
    return [f"input {name} is new: this was made without it" for name in unread(project, iteration, made)]


def unread(project: Project, iteration: Iteration | None, made: Provenance) -> list[str]:
    """Inputs that are there now and were not read: the stage would read them, so it would say another thing."""
    read = {ref.path for ref in made.inputs}
    names = dict.fromkeys(map(project.relative, would_read(project, iteration, made)))
    return [name for name in names if name not in read]


def would_read(project: Project, iteration: Iteration | None, made: Provenance) -> list[Path]:
    """The artifacts that the stage would select, of those that are there; none where it selects none by itself.

    As far as it comes: where the stage would refuse what there is, what it read is gone, and that is another reason.
    Heads alone are looked at, no HDF5, and no code of the user is run.
    """
    select = _SELECT.get(made.stage)
    found: list[Path] = []
    if select is None or (iteration is None and made.stage not in _OF_PROJECT):
        return found
    with suppress(R2S2RError):
        found.extend(select(project, iteration, made))
    return [path for path in found if path.exists()]


def _identify(project: Project, iteration: Iteration, made: Provenance) -> Iterator[Path]:
    from r2s2r_cli.commands.identify_inputs import Asked

    yield from Asked(project, iteration, also=tuple(_flags(made).get("also") or ())).artifacts()


def _plan(project: Project, iteration: Iteration, made: Provenance) -> Iterator[Path]:
    from r2s2r_cli.commands.plan_inputs import Asked

    yield from Asked(project, iteration, (), (), 0, made.settings.get("reach_m", 0.0)).artifacts()


def _compare(project: Project, iteration: Iteration, made: Provenance) -> Iterator[Path]:
    from r2s2r_cli.commands.compare_inputs import asked_again

    asked = asked_again(project, iteration, _flags(made))
    if asked.estimate(iteration).exists():  # executed runs that have no states yet: nothing can be compared with them
        yield from asked.artifacts()


def _floor(project: Project, iteration: Iteration | None, made: Provenance) -> Iterator[Path]:
    from r2s2r_cli.commands.floor import read_of, wanted_places

    yield from read_of(wanted_places(project, _flags(made).get("iterations") or ()))


def _diagnose(project: Project, iteration: Iteration, made: Provenance) -> Iterator[Path]:
    from r2s2r_cli.commands.diagnose_inputs import Asked

    asked = Asked(project, iteration, also=tuple(_flags(made).get("also") or ()))
    yield from asked.beside()
    yield from asked.artifacts()


def _flags(made: Provenance) -> dict[str, Any]:
    flags: dict[str, Any] = made.settings.get("flags", {})
    return flags


_SELECT: dict[str, Callable[[Project, Any, Provenance], Iterator[Path]]] = {
    "identify": _identify, "plan": _plan, "compare": _compare, "floor": _floor, "diagnose": _diagnose,
}  # fmt: skip
_OF_PROJECT = ("floor",)
"""Those whose artifact belongs to no iteration."""
