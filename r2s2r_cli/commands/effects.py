"""`r2s2r effects`: the physical laws that the nominal simulator lacks, listed and explained."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.options import JsonOption, QuietOption

if TYPE_CHECKING:
    from r2s2r_cli.effects import Effect
    from schemas.results_effects import EffectInfo


def effects(
    ids: Annotated[
        list[str] | None, typer.Argument(metavar="[ID]...", help="Effects to explain; default: list all.")
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """List the effects that `diagnose` looks for and `identify --with-effect` uses, or explain some of them.

    Those marked with * `diagnose` looks for only where they are named (`--effect ID`).
    An effect is a physical law that the nominal simulator lacks. Explained: what it is, where it acts, its numbers with
    bounds, what it looks like in data, what it is confused with, and its source. Installed packages can bring more.

    Example: r2s2r effects friction_field
    """
    from r2s2r_cli.effects import FURTHER
    from r2s2r_cli.stages.effects import all_effects, effect_of
    from schemas.results_effects import EffectsResult

    console = Console(json=json, quiet=quiet)
    chosen = [effect_of(one, where="ID", command="r2s2r effects") for one in dict.fromkeys(ids or ())] or all_effects()
    console.document(EffectsResult(effects=tuple(_info(one) for one in chosen)))
    if ids:
        for one in chosen:
            _explain(one, console)
        return
    rows = [[one.name + "*" * (one in FURTHER), str(one.channel), one.signature()] for one in chosen]
    console.table("effects", ["id", "channel", "what it looks like in data"], rows)
    console.data("* looked for only where it is named: r2s2r diagnose --effect catalogue --effect ID")
    console.say("r2s2r effects ID explains one of them")


def _info(effect: Effect) -> EffectInfo:
    from r2s2r_cli.effects import FURTHER
    from r2s2r_cli.effects.words import sections
    from schemas.results_effects import EffectInfo, EffectNumber

    numbers = tuple(
        EffectNumber(name=own.name, unit=own.unit, per=own.per, off=own.off, lower=own.lower, upper=own.upper,
                     prior_sd=own.scale, what=own.what, fitted=own.fitted)
        for own in effect.own
    )  # fmt: skip
    module = type(effect).__module__
    return EffectInfo(
        id=effect.name, title=effect.title, channel=str(effect.channel), signature=effect.signature(),
        look_alikes=effect.look_alikes, numbers=numbers, text=sections(effect),
        brought_by="" if module.startswith("r2s2r_cli.effects.") else module,
        looked_for=effect not in FURTHER,
    )  # fmt: skip


def _explain(effect: Effect, console: Console) -> None:
    from r2s2r_cli.effects import FURTHER
    from r2s2r_cli.effects.words import bounds, sections

    console.data(f"{effect.name}: {effect.title} (channel {effect.channel})")
    for heading, text in sections(effect).items():
        if heading != "Parameters":
            console.data(f"{heading}: {text}")
    rows = [[f"{effect.name}.{own.name}", own.unit, own.per, f"{own.off:g}", bounds(own), f"{own.scale:g}", own.what]
            for own in effect.own]  # fmt: skip
    if effect in FURTHER:
        console.data(f"Looked for: only where it is named: r2s2r diagnose --effect catalogue --effect {effect.name}")
    console.table("numbers", ["number", "unit", "per", "off", "bounds", "prior sd", "what"], rows)
