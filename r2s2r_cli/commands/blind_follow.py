"""`r2s2r blind follow`: run the gait that an ambiguous verdict asks for, and one by chance, and diagnose again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import JsonOption, QuietOption

if TYPE_CHECKING:
    from r2s2r_cli.blind.follow import Trial
    from schemas.results_follow import BlindFollowResult


def follow(
    bank: Annotated[Path, typer.Argument(metavar="BANK", help="Folder of `blind make`.")],
    verdicts: Annotated[Path, typer.Option("--verdicts", metavar="DIR", help="Folder of `blind run`.")],
    key: Annotated[
        Path, typer.Option("--key", metavar="FILE", help="Of the labels; read by the maker's process alone.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="One that was begun is gone on with.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the gait by chance, and where both begin.")] = 0,
    executor: Annotated[
        str, typer.Option("--executor", metavar="WHERE", help="local, or dask://host:port (extra `cluster`).")
    ] = "local",
    workers: Annotated[int, typer.Option("--workers", min=1, help="Sets at a time.")] = 1,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Does the gait that an ambiguous verdict suggests settle it? Run it and one by chance in the hidden world.

    A process of its own makes the world of every ambiguous set again; it is told the targets, nothing else of the
    verdict. Then both grown sets are diagnosed, watched and with the settings of the verdicts. Interrupted, the same
    command goes on. Whether what is said then is right, `blind score` tells.

    Example: r2s2r blind follow bank --verdicts verdicts --key labels.key --out follow --workers 2
    """
    from contextlib import closing

    from r2s2r_cli.blind import follow as blind_follow, run as blind_run

    console = Console(json=json, quiet=quiet)
    _apart(bank, verdicts, out)
    whole = blind_follow.trial(bank.resolve(), verdicts.resolve())
    if whole.judged < whole.sets:
        console.warn(f"{whole.sets - whole.judged} of {whole.sets} sets have no verdict: they are not followed up")
    home = out.resolve()
    asked = blind_follow.begin(whole, home, seed=seed)
    blind_follow.write(whole, home, [one for one in whole.open if not one.targets])
    runs = len(blind_follow.BANKS) * len(whole.targets)
    if runs:
        from r2s2r_cli.commands.blind_maker import make_sets

        with console.progress("gaits", runs) as advance:
            make_sets(["follow", "--bank", str(whole.bank), "--key", str(key.resolve()), "--asked", str(asked),
                       "--out", str(home), "--executor", executor, "--workers", str(workers)], advance)  # fmt: skip
    todo = blind_run.left(blind_follow.jobs(whole, home))
    with (
        console.progress("verdicts", runs) as advance,
        closing(blind_follow.run(whole, home, todo, executor=executor, workers=workers)) as found,
    ):
        advance(runs - len(todo))
        for verdict in found:
            advance(1)
            if verdict["failed"]:
                console.warn(f"{verdict['set']}: {verdict['failed'].splitlines()[0]}")
            if words := blind_follow.judged_otherwise(whole, verdict):
                console.warn(words)
    result = _result(whole, bank, out, blind_follow.write(whole, home, whole.open))
    console.document(result)
    _show(console, result)
    console.hint(f"r2s2r blind score {bank} --verdicts {verdicts} --key {key} --follow {out}")


def _apart(bank: Path, verdicts: Path, out: Path) -> None:
    """Raises UsageError where what is written would lie in the bank, or over the verdicts."""
    if out.resolve().is_relative_to(bank.resolve()):
        raise UsageError("a follow-up does not lie in the bank, which is closed", where="--out",
                         expected=f"a folder outside {bank}", received=str(out),
                         hint=f"r2s2r blind follow {bank} --verdicts verdicts --key labels.key --out follow",
                         )  # fmt: skip
    if out.resolve() == verdicts.resolve():
        raise UsageError("a follow-up would overwrite the verdicts", where="--out", expected="another folder",
                         received=str(out),
                         hint=f"r2s2r blind follow {bank} --verdicts {verdicts} --key labels.key --out follow",
                         )  # fmt: skip


def _result(whole: Trial, bank: Path, out: Path, found: tuple[dict[str, Any], ...]) -> BlindFollowResult:
    from schemas.results_follow import BlindFollowResult, FollowedSet

    told = {one["set"]: one for one in found}
    rows = tuple(
        FollowedSet(set=one.name, gait=one.gait,
                    **{which: _words(told.get(one.name, {}).get(which)) for which in ("suggested", "random")})
        for one in whole.open
    )  # fmt: skip
    after = {which: [one[which] for one in found if one[which]] for which in ("suggested", "random")}
    return BlindFollowResult(
        bank=str(bank), out=str(out), sets=whole.sets, judged=whole.judged, ambiguous=len(whole.open), done=len(found),
        without_gait=sum(not one.targets for one in whole.open),
        committed_suggested=sum(one["committed"] for one in after["suggested"]),
        committed_random=sum(one["committed"] for one in after["random"]),
        failed=sum(bool(one["failed"]) for many in after.values() for one in many), followed=rows,
        index_sha256=whole.index,
    )  # fmt: skip


def _words(said: dict[str, Any] | None) -> str | None:
    if said is None:
        return None
    return " ".join((said["verdict"] or "failed", *said["named"]))


def _show(console: Console, result: BlindFollowResult) -> None:
    rows = [(one.set, one.gait or "none suggested", one.suggested or "", one.random or "") for one in result.followed]
    console.table("Ambiguous sets", ("set", "gait", "with it", "with one by chance"), rows)
    console.data(f"{result.ambiguous} of {result.judged} sets are ambiguous, for {result.without_gait} of them nothing "
                 f"is suggested; commits after the suggested gait: {result.committed_suggested}, after one by chance: "
                 f"{result.committed_random}")  # fmt: skip
