"""Commands that a diagnosis ends with: each on a line of its own, since one in a cell of a table cannot be pasted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.reached import ROBOT

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport

REPEATS = 2
AFTER_REPAIR = "   # after you have put the robot right: these runs are taken as healthy"
"""On the lines themselves: who pastes them unread would declare the robot healthy that is diagnosed."""


def diagnose_commands(report: DiagnoseReport, robot: str = ROBOT) -> list[tuple[str, str]]:
    """(what for, command), in the order in which they are typed. robot: options by which the robot is reached."""
    command = use(report)
    found = [("use it", command)] if command else []
    if report.next_gait is None:
        healthy = _healthy(report, robot) if healthy_help(report) else ()
        return found + [("next", words) for words in healthy]
    if report.next_gait.file:
        found.append(("next", f"r2s2r record {report.next_gait.file}{_free(report)} --repeats {REPEATS} {robot}"))
    return found


def use(report: DiagnoseReport) -> str:
    """The command that puts what was named into the simulator, empty where nothing with a number was: in an iteration
    that has nothing yet, from the runs of the diagnosed one. The fit begins at the sizes that were found: where an
    effect is off, a patch of the floor has no place. No fit begins on a bound: a number that ended there begins where
    it does by itself."""
    words: list[str] = []
    for one in (one for one in report.ranking if one.effect in report.effects and one.size):
        seats = {name.split(".")[2] for name in one.size if name.count(".") == 2}
        words.append(f"--with-effect {one.effect}" + (f":{seats.pop()}" if len(seats) == 1 else ""))
        words += [
            f"--free +{name}" + ("" if name in one.on_bound else f"={value:.4g}") for name, value in one.size.items()
        ]
    also = "" if report.iteration is None else f" --also {report.iteration}"
    return " ".join([f"r2s2r identify{_free(report)}{also}", *words]) if words else ""


def healthy_help(report: DiagnoseReport) -> bool:
    """Whether what is left to do are runs from when nothing was wrong: no gait helps, and there are none."""
    lacking = any(text.startswith("healthy runs") for text in report.missing)
    return report.next_gait is None and report.verdict == "ambiguous" and lacking


def _healthy(report: DiagnoseReport, robot: str) -> tuple[str, ...]:
    """Records healthy runs in an iteration of their own and diagnoses again with them."""
    again = "" if report.iteration is None else f" --iteration {report.iteration}"
    also = "" if report.free_iteration is None else f" --also {report.free_iteration}"
    # As `record` names repeats of the random policy of seed 0, and `diagnose` the runs of another iteration.
    names = ["RUN"]
    if report.free_iteration is not None:
        names = [f"{report.free_iteration:03d}-random-0-{number}" for number in range(1, REPEATS + 1)]
    return (
        f"r2s2r record --random 15 --repeats {REPEATS}{_free(report)} {robot}{AFTER_REPAIR}",
        f"r2s2r estimate{_free(report)}",
        f"r2s2r diagnose{again}{also} {' '.join(f'--healthy {name}' for name in names)}{AFTER_REPAIR}",
    )


def _free(report: DiagnoseReport) -> str:
    """The option that names an iteration that has nothing yet, after a space."""
    return "" if report.free_iteration is None else f" --iteration {report.free_iteration}"
