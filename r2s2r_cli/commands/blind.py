"""`r2s2r blind`: blind trials of `diagnose`: make sets and run verdicts on them; `blind_score` opens the labels."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.commands.blind_follow import follow
from r2s2r_cli.commands.blind_score import calibrate, publish, score
from r2s2r_cli.commands.blind_settings import require_settings
from r2s2r_cli.commands.blind_worth import worth
from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import JsonOption, QuietOption, parse_override

blind_app = typer.Typer(help="Blind trials of diagnose: make sets, run, score.", no_args_is_help=True)


class BankName(StrEnum):
    """What `--bank` takes."""

    CALIBRATION = "calibration"
    BLIND = "blind"
    REGRESSION = "regression"


class Tier(StrEnum):
    """What `--tier` takes."""

    A = "A"
    B = "B"


Executor = Annotated[
    str, typer.Option("--executor", metavar="WHERE", help="local, or dask://host:port (extra `cluster`).")
]
Workers = Annotated[int, typer.Option("--workers", min=1, help="Sets at a time.")]


@blind_app.callback()
def blind() -> None:
    """Does `diagnose` find what is wrong where nobody told it? Sets from hidden worlds, verdicts, and the score.

    Example: r2s2r blind make --count 24 --key labels.key bank
    """


@blind_app.command("make")
def make(
    out: Annotated[
        Path, typer.Argument(metavar="BANK", help="Folder of the bank; one that was begun is gone on with.")
    ],
    key: Annotated[Path, typer.Option("--key", metavar="FILE", help="Of the labels; a new one is written.")],
    bank: Annotated[BankName, typer.Option("--bank", help="Its seeds and sizes of effects.")] = BankName.CALIBRATION,
    tier: Annotated[
        Tier, typer.Option("--tier", help="B: the MuJoCo rig. A: our own engine, other step and laws.")
    ] = Tier.B,
    count: Annotated[int, typer.Option("--count", min=1, help="Sets of the whole bank.")] = 24,
    first: Annotated[
        int | None,
        typer.Option(
            "--first",
            metavar="K",
            min=0,
            help="Number of the first set; default: 0, of a blind bank what the key decides.",
        ),
    ] = None,
    commissioning: Annotated[
        int, typer.Option("--commissioning", min=0, help="Runs of the healthy robot in each set.")
    ] = 2,
    observed: Annotated[
        int, typer.Option("--observed", min=0, help="Another number: the same motion under other camera noise.")
    ] = 0,
    effect: Annotated[
        str | None, typer.Option("--effect", metavar="ID", help="Every single effect is this one.")
    ] = None,
    gaits: Annotated[
        int | None, typer.Option("--gaits", min=2, max=8, help="Of every set; default: 3, 5 or 8 by chance.")
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option("--noise", metavar="MM", min=0.1, max=50, help="Of the caps [mm]; default: 2, 5 or 10 by chance."),
    ] = None,
    oracle: Annotated[
        bool, typer.Option("--oracle/--no-oracle", help="Compute how well each effect can be told; half of the time.")
    ] = True,
    camera: Annotated[
        bool, typer.Option("--camera", help="Pictures instead of caps, for our own tracker; 40 MB a gait.")
    ] = False,
    executor: Executor = "local",
    workers: Workers = 1,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make a bank of blind sets in a process of its own, and seal the labels.

    The key must lie outside the bank: only `blind score` is given it. Interrupted, the same command goes on.

    Example: r2s2r blind make --count 24 --key labels.key bank
    """
    from r2s2r_cli.commands.blind_maker import make_sets
    from schemas.results_blind import BlindMakeResult

    console = Console(json=json, quiet=quiet)
    if key.resolve().is_relative_to(out.resolve()):
        raise UsageError("the key lies in the bank that it locks", where="--key", expected=f"a file outside {out}",
                         received=str(key), hint=f"r2s2r blind make --key {out.name}.key {out}")  # fmt: skip
    pictures = f"r2s2r blind make --camera --key {key} {out}"
    if camera and tier is Tier.A:
        raise UsageError("tier A has no camera", where="--camera", expected="--tier B, the rig, which has one",
                         received="--tier A", hint=pictures)  # fmt: skip
    if camera and noise is not None:
        raise UsageError("pictures have the noise of the tracker", where="--noise", expected="--noise without --camera",
                         received=f"--noise {noise:g} --camera", hint=pictures)  # fmt: skip
    if first is not None:
        _check_first(first, count, bank, console)
    asked = ["--out", str(out), "--key", str(key), "--bank", bank.value, "--tier", tier.value, "--count", str(count),
             "--commissioning", str(commissioning), "--observed", str(observed), "--executor", executor,
             "--workers", str(workers), *(["--effect", effect] if effect else []),
             *([] if first is None else ["--first", str(first)]),
             *(["--gaits", str(gaits)] if gaits else []), *(["--noise", str(noise)] if noise else []),
             *([] if oracle else ["--no-oracle"]),
             *(["--camera"] if camera else [])]  # fmt: skip
    with console.progress("blind sets", count) as advance:
        make_sets(asked, advance)
    from r2s2r_cli.blind.index import read_index

    index, own = read_index(out / "index.json")
    console.document(BlindMakeResult(out=str(out), key=str(key), bank=bank.value, sets=len(index["sets"]),
                                     index_sha256=own))  # fmt: skip
    console.data(f"{len(index['sets'])} sets in {out}; publish now, before anything is diagnosed:\n{own}  index.json")
    console.hint(f"r2s2r blind run {out} --out verdicts")


@blind_app.command("run")
def run(
    bank: Annotated[Path, typer.Argument(metavar="BANK", help="Folder of `blind make`.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Of the verdicts; those there are not done again.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A setting of diagnose, as TOML, e.g. with_parity=false."),
    ] = None,
    without: Annotated[
        str | None, typer.Option("--without", metavar="ID", help="Negative control: the catalogue without this effect.")
    ] = None,
    shuffled: Annotated[
        int | None, typer.Option("--shuffled", metavar="SEED", help="Negative control: commands exchanged.")
    ] = None,
    cache: Annotated[Path | None, typer.Option("--cache", metavar="DIR", help="Of compiled steps.")] = None,
    executor: Executor = "local",
    workers: Workers = 1,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Diagnose every set of a bank, watched: whoever reaches for a label, a world or the rig is stopped.

    Example: r2s2r blind run bank --out verdicts --workers 2
    """
    import statistics
    from contextlib import closing

    from r2s2r_cli.blind import run as blind_run
    from schemas.results_blind import BlindRunResult

    console = Console(json=json, quiet=quiet)
    chosen = _settings(settings, without)
    if cache is not None:
        chosen["cache"] = str(cache.resolve())
    jobs = blind_run.jobs(bank.resolve(), out.resolve(), settings=chosen, shuffled=shuffled)
    todo = blind_run.left(jobs)
    failed, spent = [], []
    with (
        console.progress("verdicts", len(jobs)) as advance,
        closing(blind_run.run(todo, executor=executor, workers=workers)) as verdicts,
    ):
        advance(len(jobs) - len(todo))
        for verdict in verdicts:
            advance(1)
            spent.append(float(verdict["cpu_s"]))
            if verdict["failed"]:
                failed.append(str(verdict["set"]))
                console.warn(f"{verdict['set']}: {verdict['failed'].splitlines()[0]}")
    result = BlindRunResult(
        bank=str(bank), out=str(out), sets=len(jobs), done=len(jobs) - len(blind_run.left(jobs)), failed=tuple(failed),
        index_sha256=jobs[0].index, cpu_median_s=statistics.median(spent) if spent else None,
    )  # fmt: skip
    console.document(result)
    console.data(f"{result.done} of {result.sets} sets have a verdict, {len(failed)} broke off now")
    console.hint(f"r2s2r blind score {bank} --verdicts {out} --key labels.key")


blind_app.command("follow")(follow)
blind_app.command("score")(score)
blind_app.command("publish")(publish)
blind_app.command("calibrate")(calibrate)
blind_app.command("worth")(worth)


def _check_first(first: int, count: int, bank: BankName, console: Console) -> None:
    """Raises UsageError where the bank ends before the last of `count` sets."""
    from r2s2r_cli.blind.split import RANGES, Bank

    whole = len(RANGES[Bank(bank.value)].seeds)
    if first + count > whole:
        raise UsageError(f"the bank {bank.value} has no such sets", where="--first",
                         expected=f"0 to {max(whole - count, 0)} for {count} sets", received=str(first),
                         hint=f"r2s2r blind make --bank {bank.value} --first 0 --count {min(count, whole)} "
                         "--key new.key bank")  # fmt: skip
    if bank is BankName.BLIND:
        console.warn("--first is no secret: whoever knows it can make the worlds of this bank again")


def _settings(items: list[str] | None, without: str | None) -> dict[str, object]:
    # No bare words: a word in place of a number would be noticed when the first set is diagnosed, not here.
    parsed = (parse_override(item, hint=lambda key: "--set with_parity=false", words=False) for item in items or [])
    found: dict[str, object] = dict(parsed)
    require_settings(found)
    if without is not None:
        from r2s2r_cli.effects import looked_for

        ids = [effect.name for effect in looked_for()]
        if without not in ids:
            raise UsageError("the catalogue has no such effect", where="--without", expected=", ".join(ids),
                             received=without, hint="r2s2r effects")  # fmt: skip
        found["effects"] = [one for one in ids if one != without]
    return found
