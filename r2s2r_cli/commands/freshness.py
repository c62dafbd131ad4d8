"""Whether an artifact is what its stage would make now, by itself and through its inputs."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from r2s2r_cli.commands.asked_again import joined
from r2s2r_cli.commands.wanted import wanted_again
from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.store.brief import brief
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import reasons
from schemas.header import Header, InputRef
from schemas.versions import KINDS


def identity(ref: InputRef) -> tuple[str, str]:
    """What makes two inputs the same wherever they lie: file name (it names the run) and content."""
    if ref.kind in KINDS:
        return ref.path, ""  # `reasons` compares its content, through its migrations
    return Path(ref.path).name, ref.sha256


def same_inputs(recorded: Sequence[InputRef], asked: Sequence[InputRef]) -> bool:
    """Whether both name the same inputs, each by its path (its content is compared elsewhere) or its identity."""
    pairs = [(one, two) for one in recorded for two in asked if one.path == two.path or identity(one) == identity(two)]
    matched = ({one.path for one, _ in pairs}, {two.path for _, two in pairs})
    return matched == ({ref.path for ref in recorded}, {ref.path for ref in asked})


def own_reasons(project: Project, iteration: Iteration | None, header: Header) -> list[str]:
    """Why an artifact is stale by itself, asked for again as it was made."""
    made = header.provenance
    return [*reasons(project, header, wanted_again(project, iteration, made)), *joined(project, iteration, made)]


def stale_inputs(project: Project, inputs: Sequence[InputRef]) -> list[str]:
    """Which inputs are stale, by themselves or through inputs of their own, and why: what was made of them is, then, of
    old."""
    places = {place.path: place for place in project.iterations()}

    @functools.cache
    def why(name: str) -> str:
        path = project.root / name
        try:
            header = read_header(path)
            own = own_reasons(project, places.get(path.parent), header)
        except R2S2RError as error:
            return error.what  # damaged, or gone: nothing fresh
        if own:
            first, *more = brief(own)
            return f"{first}, and {len(more)} more" if more else first
        through = ((ref.path, why(ref.path)) for ref in header.provenance.inputs if ref.kind in KINDS)
        return next((f"through {name}: {text}" for name, text in through if text), "")

    pairs = [(ref.path, why(ref.path)) for ref in inputs if ref.kind in KINDS]
    return [f"its input {name} is stale itself: {text}" for name, text in pairs if text]
