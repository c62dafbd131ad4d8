"""Options that mean the same in every command that has them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from r2s2r_cli.errors import UsageError

ProjectOption = Annotated[
    Path | None,
    typer.Option("--project", metavar="DIR", help="Project directory; default: the nearest parent with project.toml."),
]
IterationOption = Annotated[
    int | None, typer.Option("--iteration", metavar="N", help="Iteration number; default: the latest.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout instead of tables.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No remarks, hints or progress on stderr.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and why; write nothing.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Do it again although the result is fresh or in the way.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override one setting, e.g. estimate.key=0.1; repeatable."),
]
DrawOption = Annotated[
    bool, typer.Option("--draw/--no-draw", help="Pictures and an HTML page beside the artifact, or none.")
]
ShowConfigOption = Annotated[bool, typer.Option("--show-config", help="Print the effective settings as TOML and stop.")]


def parse_overrides(items: list[str] | None) -> dict[str, Any]:
    """`--set a.b=value` items as dotted keys and TOML values; bare words are text. Raises UsageError."""
    import tomllib

    overrides: dict[str, Any] = {}
    for item in items or []:
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise UsageError("an override has no value", where="--set", expected="KEY=VALUE", received=item,
                             hint="--set estimate.key=0.1")  # fmt: skip
        try:
            overrides[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            overrides[key.strip()] = text
    return overrides
