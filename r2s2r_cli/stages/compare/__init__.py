"""`compare`: real runs beside the same policies in one or several simulators, each gap beside its floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.checkpoint import Answers
from r2s2r_cli.stages.compare.errors import run_errors
from r2s2r_cli.stages.compare.groups import comparison_groups
from r2s2r_cli.stages.compare.predicted import Model, PredictedRun, predicted
from r2s2r_cli.stages.compare.report import Compared, report_of
from r2s2r_cli.stages.compare.runs import RealRun, real_runs
from schemas.config import SimulateSettings
from schemas.results_compare import CompareReport

__all__ = ["Model", "RealRun", "compare", "real_runs"]


def compare(
    runs: Sequence[RealRun],
    models: Sequence[Model],
    settings: SimulateSettings,
    *,
    keyframe_floor_m: float | None = None,
    cache_dir: Path | None = None,
    checkpoint: Answers | None = None,
    done: Callable[[], None] = lambda: None,
) -> tuple[ArtifactData, CompareReport]:
    """Every run under every simulator; the layout is that of `schemas/compare.py`.

    keyframe_floor_m: of the caps, from floor.h5. checkpoint: what was simulated before is taken from there, what was
    not is kept there. done: called after each run of each simulator. Raises UsageError where two simulators have one
    name, InputError for a robot that cannot be simulated, and what the checkpoint raises.
    """
    names = [model.name for model in models]
    for name in names:
        if names.count(name) > 1:
            raise UsageError("two simulators would have the same name", where="--model", expected="a name for each",
                             received=name, hint="--model first=a.h5 --model second=b.h5")  # fmt: skip
    table: dict[str, Mapping[str, PredictedRun]] = {}
    for model in models:
        found = predicted(model, runs, settings, cache_dir=cache_dir, checkpoint=checkpoint, done=done)
        table[model.name] = {one.run: one for one in found}
    compared = [
        Compared(run, model, one := table[model.name][run.name],
                 None if one.walk is None or one.real is None else run_errors(one.real, one.walk))
        for run in runs
        for model in models
    ]  # fmt: skip
    report = report_of(runs, models, compared, keyframe_floor_m)
    return ArtifactData("comparison", comparison_groups(runs, models, compared, report)), report
