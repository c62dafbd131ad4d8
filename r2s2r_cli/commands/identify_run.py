"""What `identify` does between its inputs and its report: load, fit with progress and checkpoint, keep the time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from r2s2r_cli.commands.interrupts import loaded
from r2s2r_cli.console import Console

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.identify_inputs import Asked
    from r2s2r_cli.stages.identify.request import Step
    from r2s2r_cli.store.checkpoint import CheckpointFile
    from schemas.config import IdentifySettings
    from schemas.results_identify import IdentifyReport


def compute(
    asked: Asked, settings: IdentifySettings, checkpoint: CheckpointFile, console: Console
) -> tuple[ArtifactData, IdentifyReport]:
    """Fit; the report knows how long each part took. What is asked for is checked before anything heavy is loaded."""
    runs = asked.runs()
    request = asked.request(runs, settings)
    stage = loaded("r2s2r_cli.stages.identify")
    clock = Clock()
    with _shown(console, clock) as progress:
        data, report = stage.identify(
            asked.project.robot(), runs, request, settings, cache_dir=asked.project.cache, progress=progress,
            checkpoint=checkpoint,
        )  # fmt: skip
    return data, report.model_copy(update={"wall_s": clock.total(), "seconds": clock.seconds()})


def plant(asked: Asked, settings: IdentifySettings, console: Console) -> None:
    """The self-test: print what came back of planted values. Nothing is written."""
    from r2s2r_cli.views.identify_self_test import self_test_tables
    from schemas.results_identify import SelfTestReport, SelfTestResult

    runs = asked.runs()
    request = asked.request(runs, settings)
    stage = loaded("r2s2r_cli.stages.identify.self_tested")
    clock = Clock()
    with _shown(console, clock) as progress:
        report: SelfTestReport = stage.self_tested(
            asked.project.robot(), runs, request, settings, cache_dir=asked.project.cache, progress=progress
        )
    inputs = tuple(ref.path for ref in asked.refs())
    console.document(SelfTestResult(inputs=inputs, wall_s=clock.total(), report=report))
    for table in self_test_tables(report):
        console.table(table.title, table.columns, table.rows)
    for text in report.warnings:
        console.warn(text)


class Clock:
    """Wall time of each part of the work [s], from when it is first named to when another is."""

    def __init__(self) -> None:
        self._begin = self._since = time.monotonic()
        self._spent: dict[str, float] = {}
        self._part = ""

    def enter(self, part: str) -> None:
        """From now on the time is of this part."""
        if part != self._part:
            self._book()
            self._part = part

    def total(self) -> float:
        """Since the beginning."""
        return round(time.monotonic() - self._begin, 3)

    def seconds(self) -> dict[str, float]:
        """By part, in the order in which they were named; what came before the first counts to it."""
        self._book()
        return {part: round(spent, 3) for part, spent in self._spent.items()}

    def _book(self) -> None:
        now = time.monotonic()
        if self._part:
            self._spent[self._part] = self._spent.get(self._part, 0.0) + now - self._since
            self._since = now


@contextmanager
def _shown(console: Console, clock: Clock) -> Iterator[Callable[[Step], None]]:
    with console.parts() as show:

        def progress(step: Step) -> None:
            clock.enter(step.part)
            show(step.part, step.done, step.total, "" if step.cost is None else f"loss {step.cost:.6g}")

        yield progress
