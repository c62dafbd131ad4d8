"""Options that mean the same in every command that has them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest

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


def parse_overrides(items: list[str] | None, stage: str) -> dict[str, Any]:
    """`--set stage.key=value` items as dotted keys and TOML values; bare words are text.

    Raises UsageError as `parse_override` does, and for an item of another stage, which would be ignored in silence.
    """
    overrides: dict[str, Any] = {}
    for item in items or []:
        key, value = parse_override(item, expected=f"{stage}.KEY=VALUE", hint=lambda key: _meant(stage, key, None))
        if key.split(".")[0] != stage or "." not in key:
            raise UsageError(
                f"this is no setting of {stage}", where="--set", expected=f"{stage}.KEY=VALUE", received=item,
                hint=_meant(stage, key, item.partition("=")[2]),
            )  # fmt: skip
        overrides[key] = value
    return overrides


def parse_override(
    item: str, *, hint: Callable[[str], str], expected: str = "KEY=VALUE", words: bool = True
) -> tuple[str, Any]:
    """Key and value of one `--set KEY=VALUE`, the value as TOML.

    words: what is no TOML is taken as text, as typed. hint: what mends it, of the key. Raises UsageError where key or
    value is missing, for several values in one (of which all but the first would be lost), and for no TOML if not
    `words`.
    """
    import tomllib

    name, equals, text = item.partition("=")
    key = name.strip()
    if not equals or not key:
        raise UsageError("an override has no value", where="--set", expected=expected, received=item or "nothing",
                         hint=hint(key))  # fmt: skip
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError) as error:  # no TOML, a number of too many digits, too deep a list
        if not words:
            raise UsageError("the value is no TOML", where="--set", expected=expected, received=item,
                             hint=hint(key)) from error  # fmt: skip
        parsed = {"value": text}
        several = "\n" in text.strip()  # a word in front of further keys
    else:
        several = len(parsed) > 1
    if several:
        raise UsageError("an override has more than one value", where="--set",
                         expected=f"{expected}, an option for each", received=item, hint=hint(key))  # fmt: skip
    return key, parsed["value"]


def _meant(stage: str, key: str, text: str | None) -> str:
    """The hint for an override that is none of `stage`: the setting that was probably meant, with the text that was
    given, or without one with the value that holds; where none is near, what lists them. An option alone is completed
    by the command."""
    from r2s2r_cli.store.toml_hints import override, override_text
    from schemas.config import RunConfig

    settings = RunConfig().model_dump(mode="json", by_alias=True).get(stage, {})
    near = nearest(key.rpartition(".")[2], settings)
    if not near:
        return f"r2s2r {stage} --show-config"
    meant = f"{stage}.{near}"
    return override(meant, settings[near]) if text is None else override_text(meant, text)
