"""What an effect's file says about it: the headings of its docstring, and the page of the whole catalogue."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence

from r2s2r_cli.effects.base import Effect, EffectParameter

HEADINGS = (
    "What it is", "Where it acts", "Parameters", "What it looks like in data", "What it is confused with", "Source",
)  # fmt: skip
"""Of every effect's file, in this order."""

_HEAD = """# Effects

Physical laws that the nominal simulator lacks. At its off value an effect changes nothing, bit by bit. `r2s2r diagnose`
says which of them a recording asks for; `r2s2r identify --with-effect ID` puts one into the simulator and fits its
numbers, `--with-effect ID:K` those of one element. `r2s2r effects ID` prints one of these sections;
[how to extend](../how-to-extend.md#a-new-effect) says how to add one. Channels are the places where an effect acts:
command, motor, cable, mass, contact, world, sensing (what the controller reads and the log holds), observation (what
the camera sees).
"""

_FURTHER = """Looked for only where they are named: `r2s2r diagnose --effect ID`, alone or, with `--effect catalogue`,
beside those above. The thresholds of `diagnose` are calibrated on sets without them. Everything else knows them as it
does the others.
"""


def sections(effect: Effect) -> dict[str, str]:
    """Text by heading, one line each; headings that the file lacks are left out."""
    text = inspect.getdoc(inspect.getmodule(type(effect))) or ""
    pattern = "|".join(map(re.escape, HEADINGS))
    parts = re.split(rf"^({pattern}):", text, flags=re.MULTILINE)
    return {heading: " ".join(body.split()) for heading, body in zip(parts[1::2], parts[2::2], strict=True)}


def page(effects: Sequence[Effect], further: Sequence[Effect]) -> str:
    """Markdown of effects: a table of those that are looked for, one of those `further`, then one section each."""
    sections = "".join(_section(one) for one in (*effects, *further))
    return f"{_HEAD}\n{_table(effects)}\n{_FURTHER}\n{_table(further)}{sections}"


def _table(effects: Sequence[Effect]) -> str:
    rows = "\n".join(
        f"| [`{one.name}`](#{one.name}) | {one.title} | {one.channel} | {one.signature()} |" for one in effects
    )
    return f"| id | effect | channel | what it looks like in data |\n| --- | --- | --- | --- |\n{rows}\n"


def bounds(own: EffectParameter) -> str:
    """Bounds in the number's unit."""
    return f"{own.lower:g} to {own.upper:g}"


def _section(effect: Effect) -> str:
    lines = [f"\n## {effect.name}\n", f"{effect.title.capitalize()}, channel {effect.channel}.\n"]
    found = sections(effect)
    for heading in HEADINGS:
        if heading != "Parameters" and heading in found:
            lines.append(f"- *{heading}*: {found[heading]}")
    lines.append(
        "\n| number | unit | per | off | bounds | prior sd | what |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    lines += [
        f"| `{effect.name}.{own.name}` | {own.unit} | {own.per} | {own.off:g} | {bounds(own)} | {own.scale:g} "
        f"| {own.what} |"
        for own in effect.own
    ]
    return "\n".join(lines) + "\n"
