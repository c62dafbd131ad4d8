"""`r2s2r blind`: blind trials of `diagnose`: make sets, run verdicts on them, open the labels and score."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.commands.blind_follow import follow
from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import DrawOption, JsonOption, QuietOption

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
    oracle: Annotated[
        bool, typer.Option("--oracle/--no-oracle", help="Compute how well each effect can be told; half of the time.")
    ] = True,
    executor: Executor = "local",
    workers: Workers = 1,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make a bank of blind sets in a process of its own, and seal the labels.

    The key must lie outside the bank: only `blind score` is given it. Interrupted, the same command goes on.

    Example: r2s2r blind make --count 24 --key labels.key bank
    """
    from schemas.results_blind import BlindMakeResult

    console = Console(json=json, quiet=quiet)
    if key.resolve().is_relative_to(out.resolve()):
        raise UsageError("the key lies in the bank that it locks", where="--key", expected=f"a file outside {out}",
                         received=str(key), hint=f"r2s2r blind make --key {out.name}.key {out}")  # fmt: skip
    asked = ["--out", str(out), "--key", str(key), "--bank", bank.value, "--tier", tier.value, "--count", str(count),
             "--commissioning", str(commissioning), "--observed", str(observed), "--executor", executor,
             "--workers", str(workers), *(["--effect", effect] if effect else []),
             *(["--gaits", str(gaits)] if gaits else []), *([] if oracle else ["--no-oracle"])]  # fmt: skip
    with console.progress("blind sets", count) as advance:
        _maker(asked, advance)
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

    from r2s2r_cli.blind import run as blind_run
    from schemas.results_blind import BlindRunResult

    console = Console(json=json, quiet=quiet)
    chosen = _settings(settings, without)
    if cache is not None:
        chosen["cache"] = str(cache.resolve())
    jobs = blind_run.jobs(bank.resolve(), out.resolve(), settings=chosen, shuffled=shuffled)
    todo = blind_run.left(jobs)
    failed, spent = [], []
    with console.progress("verdicts", len(jobs)) as advance:
        advance(len(jobs) - len(todo))
        for verdict in blind_run.run(todo, executor=executor, workers=workers):
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


@blind_app.command("score")
def score(
    bank: Annotated[Path, typer.Argument(metavar="BANK", help="Folder of `blind make`.")],
    verdicts: Annotated[Path, typer.Option("--verdicts", metavar="DIR", help="Folder of `blind run`.")],
    key: Annotated[Path, typer.Option("--key", metavar="FILE", help="Of the labels.")],
    again: Annotated[
        Path | None,
        typer.Option("--again", metavar="DIR", help="Verdicts on the same worlds under other noise: how many agree."),
    ] = None,
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE", help="HTML page; default: score.html beside the verdicts.")
    ] = None,
    draw: DrawOption = True,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Open the labels, check them against what was committed to, and print every figure with n and interval.

    Example: r2s2r blind score bank --verdicts verdicts --key labels.key
    """
    from r2s2r_cli.blind.labels import read_key
    from r2s2r_cli.blind.score import score as judge
    from r2s2r_cli.views.blind import blind_page, blind_tables, draw_blind

    console = Console(json=json, quiet=quiet)
    result = judge(bank, verdicts, read_key(key), again=again)
    console.document(result)
    for table in blind_tables(result):
        console.table(table.title, table.columns, table.rows)
    for text in result.warnings:
        console.warn(text)
    if draw:
        pictures = dict(draw_blind(result))
        target = page or verdicts.parent / f"{verdicts.name}-score.html"
        target.write_bytes(blind_page(result, pictures))
        for name, png in pictures.items():
            target.with_name(f"{target.stem}-{name}.png").write_bytes(png)
        console.say(f"page: {target}")


@blind_app.command("calibrate")
def calibrate(
    bank: Annotated[Path, typer.Argument(metavar="BANK", help="A calibration bank of `blind make`.")],
    verdicts: Annotated[Path, typer.Option("--verdicts", metavar="DIR", help="Folder of `blind run`.")],
    key: Annotated[Path, typer.Option("--key", metavar="FILE", help="Of the labels.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="JSON, for stages/diagnose/which.")],
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Learn from a calibration bank how gains become probabilities, and from which one on a name is committed to.

    Example: r2s2r blind calibrate bank --verdicts verdicts --key labels.key --out calibration.json
    """
    import json as format_json

    from r2s2r_cli.blind.labels import read_key
    from r2s2r_cli.blind.score import calibration
    from schemas.results_blind import BlindCalibrateResult

    console = Console(json=json, quiet=quiet)
    found = calibration(bank, verdicts, read_key(key))
    out.write_text(format_json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    result = BlindCalibrateResult.model_validate({**found, "out": str(out), **found["left_out"]}, extra="ignore")
    console.document(result)
    console.data(f"{result.sets} sets: temperature {result.temperature:.1f} nats, a name from {result.commit:.2f} on; "
                 f"first guess right in {100 * result.top1:.0f} % of the sets left out")  # fmt: skip


def _settings(items: list[str] | None, without: str | None) -> dict[str, object]:
    import tomllib

    found: dict[str, object] = {}
    for item in items or []:
        name, equals, text = item.partition("=")
        try:
            found[name.strip()] = tomllib.loads(f"value = {text}")["value"]
        except (tomllib.TOMLDecodeError, KeyError) as error:
            raise UsageError("this is no setting", where="--set", expected="KEY=VALUE, the value as TOML",
                             received=item, hint="--set with_parity=false") from error  # fmt: skip
        if not equals:
            raise UsageError("a setting has no value", where="--set", expected="KEY=VALUE", received=item,
                             hint="--set with_parity=false")  # fmt: skip
    if without is not None:
        from r2s2r_cli.effects import CATALOGUE

        ids = [effect.name for effect in CATALOGUE]
        if without not in ids:
            raise UsageError("the catalogue has no such effect", where="--without", expected=", ".join(ids),
                             received=without, hint="r2s2r effects")  # fmt: skip
        found["effects"] = [one for one in ids if one != without]
    return found


def _maker(asked: list[str], advance: object) -> None:
    """The maker's process; its errors are ours."""
    import importlib.util
    import json
    import subprocess
    import sys

    from r2s2r_cli.errors import InputError, NumericalError

    for module, extra in (("mujoco", "rig"), ("cryptography", "blind")):
        if importlib.util.find_spec(module) is None:
            raise UsageError(f"{module} is not installed", where="r2s2r blind make", expected=f"the extra `{extra}`",
                             received="no such module", hint="pip install 'r2s2r[blind]'")  # fmt: skip
    command = [sys.executable, "-m", "r2s2r_cli.blind.make", *asked]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as maker:
        assert maker.stdout is not None and maker.stderr is not None  # noqa: S101 - both are pipes
        done = 0
        for line in maker.stdout:
            now = int(json.loads(line)["done"])
            advance(now - done)  # type: ignore[operator]
            done = now
        words = maker.stderr.read().strip()
        code = maker.wait()
    if code == 130:
        raise KeyboardInterrupt
    if code:
        kind = NumericalError if code == 6 else UsageError if code == 2 else InputError
        raise kind("the maker of blind sets broke off", where="r2s2r blind make", expected="exit code 0",
                   received=words or f"exit code {code}",
                   hint="r2s2r blind make --count 4 --key try.key try")  # fmt: skip
