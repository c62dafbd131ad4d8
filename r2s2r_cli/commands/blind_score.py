"""`r2s2r blind score`, `publish` and `calibrate`: what is done with labels and verdicts, or with published files."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.commands.typed import typed_words
from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import DrawOption, JsonOption, QuietOption
from r2s2r_cli.store.atomic import write_bytes, write_text

_BANKS = typer.Argument(metavar="BANK | FILE...", help="Folder of `blind make`; with --published: published files.")
Published = Annotated[
    bool, typer.Option("--published", help="Files of `blind publish` instead of a bank; they need no key.")
]
Verdicts = Annotated[Path | None, typer.Option("--verdicts", metavar="DIR", help="Folder of `blind run`.")]
Key = Annotated[Path | None, typer.Option("--key", metavar="FILE", help="Of the labels.")]
Follow = Annotated[
    Path | None, typer.Option("--follow", metavar="DIR", help="Folder of `blind follow`: what one more gait decided.")
]


def score(
    banks: Annotated[list[Path], _BANKS],
    verdicts: Verdicts = None,
    key: Key = None,
    published: Published = False,
    again: Annotated[
        list[Path] | None,
        typer.Option("--again", metavar="DIR", help="Verdicts on the same worlds under other noise: how many agree. "
                     "With --published also a file, and several."),
    ] = None,
    follow: Follow = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE", help="HTML page; default: NAME-score.html beside the verdicts, of "
                     "published files here."),
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option("--markdown", metavar="FILE", help="Also all tables as Markdown, to be published.")
    ] = None,
    draw: DrawOption = True,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:  # fmt: skip
    """Open the labels, check them against what was committed to, and print every figure with n and interval.

    With --published several banks (shards) of one tier and kind are scored as one.

    Example: r2s2r blind score --published docs/blind/blind-b-1.json.gz docs/blind/blind-b-2.json.gz
    """
    from r2s2r_cli.blind.score import score as of_bank, score_published
    from r2s2r_cli.views.blind import blind_page, blind_tables, draw_blind

    console = Console(json=json, quiet=quiet)
    if published:
        _alone(verdicts, key)
        result = score_published(banks, again=again or (), follow=follow)
        beside = Path(banks[0].name.removesuffix(".gz")).with_suffix("")
    else:
        bank, verdicts, secret = _bank(banks, verdicts, key, "score")
        if again is not None and len(again) > 1:
            raise UsageError(
                "a bank has one second run of verdicts", where="--again", expected="one folder",
                received=str(len(again)), hint="r2s2r blind score --published FILE --again FILE",
            )  # fmt: skip
        result = of_bank(bank, verdicts, secret, again=again[0] if again else None, follow=follow)
        beside = verdicts
    console.document(result)
    for table in blind_tables(result):
        console.table(table.title, table.columns, table.rows)
    for text in result.warnings:
        console.warn(text)
    if markdown is not None:
        from r2s2r_cli.views.blind_markdown import blind_markdown

        write_text(markdown, blind_markdown(result))
        console.say(f"tables: {markdown}")
    if draw:
        pictures = dict(draw_blind(result))
        target = page or beside.parent / f"{beside.name}-score.html"
        write_bytes(target, blind_page(result, pictures))
        for name, png in pictures.items():
            write_bytes(target.with_name(f"{target.stem}-{name}.png"), png)
        console.say(f"page: {target}")


def publish(
    bank: Annotated[Path, typer.Argument(metavar="BANK", help="Folder of `blind make`.")],
    verdicts: Annotated[Path, typer.Option("--verdicts", metavar="DIR", help="Folder of `blind run`.")],
    key: Annotated[Path, typer.Option("--key", metavar="FILE", help="Of the labels.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="JSON; compressed where it ends with .gz.")],
    follow: Follow = None,
    code: Annotated[
        Path | None,
        typer.Option(
            "--code", metavar="DIR", help="Checkout whose code judged, for verdicts that do not say; default: this."
        ),
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Open the labels, check as `score` does, and write one file that anybody can check and score without the key.

    It opens every label that has a verdict: from then on the bank is not blind any more.

    Example: r2s2r blind publish bank --verdicts verdicts --key labels.key --out docs/blind/blind-b-1.json.gz
    """
    from r2s2r_cli.blind.labels import read_key
    from r2s2r_cli.blind.score import publish as opened
    from r2s2r_cli.blind.score.published import write_form
    from schemas.blind import BlindPublished
    from schemas.results_blind import BlindPublishResult

    console = Console(json=json, quiet=quiet)
    data = opened(bank, verdicts, read_key(key), judged_by=code, follow=follow)
    form = write_form(data, out.name)
    write_bytes(out, form)
    told = BlindPublished.model_validate_json(data)
    warnings = []
    if told.missing:
        warnings.append(f"{len(told.missing)} sets have no verdict; labels that are open tell seeds: judge none of "
                        "them from now on")  # fmt: skip
    if any(one.changed for one in told.code):
        warnings.append("the checkout that judged had changes that were not committed: its commit does not say them")
    if len({one.sources_sha256 for one in told.code}) > 1:
        warnings.append("the code of the diagnosis changed between these verdicts")
    result = BlindPublishResult(
        out=str(out), bytes=len(form), sets=len(told.sets), missing=told.missing, index_sha256=told.index_sha256,
        content_sha256=told.content_sha256, commits=tuple(one.commit for one in told.code if one.commit),
        sources_sha256=tuple(dict.fromkeys(one.sources_sha256 for one in told.code)), warnings=tuple(warnings),
    )  # fmt: skip
    console.document(result)
    console.data(f"{result.sets} sets in {out}, {result.bytes / 1000 / result.sets:.1f} kB each\n"
                 f"{told.index_sha256}  index.json, as it was published before the verdicts")  # fmt: skip
    for text in warnings:
        console.warn(text)
    console.hint(f"r2s2r blind score --published {out}")


def calibrate(
    banks: Annotated[list[Path], _BANKS],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="JSON, for stages/diagnose/which.")],
    verdicts: Verdicts = None,
    key: Key = None,
    published: Published = False,
    older: Annotated[
        list[Path] | None,
        typer.Option("--older", metavar="FILE", help="Published shards of versions that counted gains otherwise: they "
                     "teach only how much the best effect may leave. Several."),
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:  # fmt: skip
    """Learn from a calibration bank how gains become probabilities, and from which one on a name is committed to.

    Example: r2s2r blind calibrate --published docs/blind/calibration-11.json.gz --out calibration.json
    """
    import json as format_json

    from r2s2r_cli.blind.score import calibration, calibration_published
    from schemas.results_blind import BlindCalibrateResult

    console = Console(json=json, quiet=quiet)
    if published:
        _alone(verdicts, key)
        found = calibration_published(banks, older or ())
    else:
        found = calibration(*_bank(banks, verdicts, key, "calibrate"), older or ())
    write_text(out, format_json.dumps(found, indent=1, sort_keys=True) + "\n")
    result = BlindCalibrateResult.model_validate({**found, "out": str(out), **found["left_out"]}, extra="ignore")
    console.document(result)
    console.data(f"{result.sets} sets: temperature {result.temperature:.1f} nats, a name from {result.commit:.2f} on; "
                 f"first guess right in {100 * result.top1:.0f} % of the sets left out")  # fmt: skip


def _bank(banks: list[Path], verdicts: Path | None, key: Path | None, command: str) -> tuple[Path, Path, bytes]:
    """Folder, verdicts and key. Raises UsageError where one of them is not given, InputError for a key that is none."""
    from r2s2r_cli.blind.labels import read_key

    if len(banks) != 1:
        raise UsageError("several banks are put together from their published files", where="BANK", expected="one",
                         received=str(len(banks)), hint=f"r2s2r blind {command} --published FILE...")  # fmt: skip
    given = {"--verdicts": (verdicts, "verdicts"), "--key": (key, "labels.key")}
    lacking = [word for name, (value, usual) in given.items() if value is None for word in (name, usual)]
    if lacking:
        published = f"r2s2r blind {command} --published {banks[0]}"
        raise UsageError("a bank is opened with its key and its verdicts", where=lacking[0],
                         expected=f"{lacking[0]} FILE", received="nothing",
                         hint=published if banks[0].is_file() else _typed(command, banks[0], lacking))  # fmt: skip
    assert verdicts is not None and key is not None  # noqa: S101 - just looked at
    return banks[0], verdicts, read_key(key)


def _typed(command: str, bank: Path, more: Sequence[str]) -> str:
    """The command line as it was typed, with what it lacks; where another program runs it, command and bank alone."""
    words = typed_words("blind")
    return shlex.join(["r2s2r", *(words if len(words) > 1 else ["blind", command, str(bank)]), *more])


def _alone(verdicts: Path | None, key: Path | None) -> None:
    for name, value in (("--verdicts", verdicts), ("--key", key)):
        if value is not None:
            raise UsageError("a published file holds its verdicts and opened labels", where=name,
                             expected="nothing, with --published", received=str(value),
                             hint="r2s2r blind score --published FILE...")  # fmt: skip
