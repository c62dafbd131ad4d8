"""`r2s2r blind worth`: what each kind of evidence is worth, from published files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.options import JsonOption, QuietOption


def worth(
    judged: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Published shards that are judged, of the blind bank.")
    ],
    learned: Annotated[
        list[Path],
        typer.Option("--learned", metavar="FILE", help="Published shard of the calibration bank that teaches the "
                     "probabilities; several times for several."),
    ],
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:  # fmt: skip
    """Leave out one kind of evidence after another: learn probabilities without it, and judge other sets by them.

    Example: r2s2r blind worth docs/blind/blind-b-6.json.gz --learned docs/blind/calibration-10.json.gz
    """
    from r2s2r_cli.blind.score import worth_published
    from r2s2r_cli.views.blind_worth import worth_table

    console = Console(json=json, quiet=quiet)
    result = worth_published(learned, judged)
    console.document(result)
    table = worth_table(result)
    console.table(table.title, table.columns, table.rows)
    for text in result.warnings:
        console.warn(text)
