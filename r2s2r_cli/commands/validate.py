"""`r2s2r validate`: is what is stored right, in itself, against its schema, and against the rest of the project?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import ArtifactError, ExitCode, GateError, UsageError
from r2s2r_cli.nearest import nearest
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from schemas.results import Finding, ValidateResult

if TYPE_CHECKING:
    from r2s2r_cli.checks.base import Check
    from r2s2r_cli.commands.places import Place, Places


def validate(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Artifacts, robot.toml, project.toml, config.toml, policies; default: the whole project."),
    ] = None,
    select: Annotated[
        str | None, typer.Option("--select", metavar="NAMES", help="Only these checks, separated by commas.")
    ] = None,
    ignore: Annotated[
        str | None, typer.Option("--ignore", metavar="NAMES", help="All checks but these, separated by commas.")
    ] = None,
    iteration: Annotated[
        int | None, typer.Option("--iteration", metavar="N", help="Only the files of iteration N.")
    ] = None,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Check files: can they be read, have they the form of their schema, do their numbers make this robot.

    Leaves with 3 where a check found an error, 4 where a file cannot be read. docs/reference/checks.md has the checks.

    Example: r2s2r validate iterations/001/10-record.h5
    """
    from r2s2r_cli.commands.places import Places, files_of, journals_of, shown

    console = Console(json=json, quiet=quiet)
    chosen = choose(select, ignore)
    places = Places()
    if files:
        if iteration is not None:
            raise UsageError("--iteration and files exclude each other", where="--iteration", expected="one of the two",
                             received="both", hint=f"r2s2r validate --iteration {iteration}")  # fmt: skip
        names = [shown(path) if path.is_absolute() else str(path) for path in dict.fromkeys(files)]
        found = _check(names, chosen, project, places, console)
    else:
        place = _here(project, places)
        names = [shown(path) for path in files_of(place, iteration)]
        found = _check(names, chosen, place.root, places, console)
        from r2s2r_cli.checks.base import run_checks

        found += run_checks(chosen, journals_of(place), shown(place.root))
    result = _result(names, chosen, found)
    console.document(result)
    _show(result, console)
    _leave(result)


def choose(select: str | None, ignore: str | None) -> list[Check]:
    """The checks to run, in the order of the registry. Raises UsageError for unknown names."""
    from r2s2r_cli.checks import CHECKS
    from r2s2r_cli.checks.files import ALWAYS

    wanted, unwanted = _names(select, "--select"), _names(ignore, "--ignore")
    required = {entry.name for entry in ALWAYS if entry.importance == "error"}
    for name in sorted(required & unwanted):
        others = ",".join(sorted(unwanted - required))
        raise UsageError(f"{name} cannot be ignored: a file that cannot be read has not passed", where="--ignore",
                         expected="another check", received=name,
                         hint="r2s2r validate" + (f" --ignore {others}" if others else ""))  # fmt: skip
    return [entry for entry in CHECKS if (not wanted or entry.name in wanted) and entry.name not in unwanted]


def _names(text: str | None, option: str) -> set[str]:
    from r2s2r_cli.checks import CHECKS

    known = [entry.name for entry in CHECKS]
    names = {name.strip() for name in (text or "").split(",") if name.strip()}
    if text is not None and not names:
        raise UsageError("no check is named", where=option, expected="names separated by commas", received=repr(text),
                         hint=f"r2s2r validate {option} {known[0]}")  # fmt: skip
    for name in sorted(names - set(known)):
        near = nearest(name, known)
        lists = "r2s2r validate --help   # docs/reference/checks.md lists the checks"
        hint = f"r2s2r validate {option} {near}" if near else lists
        raise UsageError(f"there is no check {name}", where=option, expected=near or "a name of a check",
                         received=name, hint=hint)  # fmt: skip
    return names


def _here(project: Path | None, places: Places) -> Place:
    """The project that is meant. One whose project.toml is wrong counts: that is a finding."""
    from r2s2r_cli.store.project import Project

    place = places.of(project or Path.cwd())
    if place is None or (project is not None and place.root != project.absolute()):
        Project.find(project)  # says what is missing
        raise ArtifactError("there is no project here", where=str(project or Path.cwd()), expected="project.toml",
                            received="none", hint="r2s2r init myrobot")  # fmt: skip
    return place


def _check(
    names: Sequence[str], chosen: Sequence[Check], project: Path | None, places: Places, console: Console
) -> list[Finding]:
    from r2s2r_cli.commands.validate_again import told_again
    from r2s2r_cli.commands.validation import findings_of, gather
    from r2s2r_cli.store.isolated import IsolatedReader

    found: list[Finding] = []
    told: set[str] = set()
    with IsolatedReader() as reader, console.progress("files", len(names)) as advance:
        for name in names:
            place = places.of(project or Path(name))
            for remark in _remarks(place, names):
                if remark not in told:
                    told.add(remark)
                    console.say(remark)
            gathered = gather(Path(name), place, reader)
            header = gathered.links.header if gathered.links is not None else None
            found += told_again(findings_of(gathered, name, chosen), Path(name), header, place)
            advance(1)
    return found


def _remarks(place: Place | None, names: Sequence[str]) -> Iterator[str]:
    """What could not be checked. Why is said here only where no finding says it: where that file is not looked at."""
    from r2s2r_cli.commands.places import shown
    from r2s2r_cli.store.project import PROJECT_FILE

    if place is None:
        yield "no project above these files: checks against the robot and the inputs are left out"
    elif place.robot is None and place.problem is not None:
        culprit = shown(place.project.robot_path if place.project is not None else place.root / PROJECT_FILE)
        why = "has an error, see below" if culprit in names else f"cannot be used: {place.problem.what}"
        yield f"checks against the robot are left out: {culprit} {why}"


def _result(files: Sequence[str], chosen: Sequence[Check], found: Sequence[Finding]) -> ValidateResult:
    from r2s2r_cli.checks.files import ALWAYS, values_allowed

    fatal = {entry.name for entry in ALWAYS if entry.importance == "error" and entry is not values_allowed}
    count = {name: sum(finding.importance == name for finding in found) for name in ("error", "warning", "advice")}
    return ValidateResult(
        files=tuple(files), checks=tuple(entry.name for entry in chosen), findings=tuple(found),
        unreadable=tuple(dict.fromkeys(f.file for f in found if f.check in fatal)),
        errors=count["error"], warnings=count["warning"], advice=count["advice"],
    )  # fmt: skip


def _show(result: ValidateResult, console: Console) -> None:
    for importance in ("error", "warning", "advice"):
        blocks: dict[tuple[str, ...], list[Finding]] = {}
        for finding in result.findings:
            if finding.importance == importance:
                key = (finding.check, finding.file, finding.what, finding.expected, finding.hint)
                blocks.setdefault(key, []).append(finding)
        for group in blocks.values():
            _show_block(group, console)
    console.data(_summary(result))


def _show_block(group: Sequence[Finding], console: Console) -> None:
    first = group[0]
    console.data(f"{first.importance}: {first.what}  [{first.check}]")
    more = f" (and {len(group) - 1} more places)" if len(group) > 1 else ""
    console.data(f"  where:    {_where(first)}{more}")
    if first.expected:
        console.data(f"  expected: {first.expected}")
    if first.received:
        console.data(f"  received: {first.received}")
    console.data(f"  hint:     {first.hint}\n")


def _where(finding: Finding) -> str:
    """`10-record.h5: runs/crawl/caps/p_WE`, `robot.toml: key rods.0`, or the file alone."""
    return f"{finding.file}: {finding.location}" if finding.location else finding.file


def _summary(result: ValidateResult) -> str:
    def counted(count: int, one: str, many: str) -> str:
        return f"{count} {one if count == 1 else many}"

    parts = [counted(result.errors, "error", "errors"), counted(result.warnings, "warning", "warnings"),
             f"{result.advice} advice"]  # fmt: skip
    # Each looks at all the places it fits, so that their number is not that of what was looked at.
    kinds = counted(len(result.checks), "kind of check", "kinds of checks")
    return f"{counted(len(result.files), 'file', 'files')}, {kinds}: {', '.join(parts)}"


def _leave(result: ValidateResult) -> None:
    """Raise what gives the exit code: 4 where a file cannot be read, else 3 where a check found an error."""
    first = next((finding for finding in result.findings if finding.importance == "error"), None)
    if first is None:
        return
    files = {finding.file for finding in result.findings if finding.importance == "error"}
    errors = "1 error" if result.errors == 1 else f"{result.errors} errors"
    code, what = ExitCode.GATE, f"{errors} in {len(files)} of {len(result.files)} files"
    if result.unreadable:
        code, what = ExitCode.INPUT, f"{len(result.unreadable)} of {len(result.files)} files cannot be read"
        first = next(finding for finding in result.findings if finding.file == result.unreadable[0])
    raise GateError(what, exit_code=code, where=_where(first), expected=first.expected, received=first.received,
                    hint=first.hint)  # fmt: skip
