"""The comparison in figures, of runs whose simulations are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from r2s2r_cli.stages.compare.opening import Opening
from r2s2r_cli.stages.compare.predicted import Model, PredictedRun
from r2s2r_cli.stages.compare.report import Compared, report_of
from r2s2r_cli.stages.compare.runs import RealRun
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.simulate.policies import Sequence
from tests.stages.compare.test_errors import walk

NONE = Sequence(np.zeros((0, 6)), np.zeros(0), np.zeros(0))


def compared(model: Model, name: str, real: Walk, simulated: Walk) -> Compared:
    """A run of a policy of its name, of which as much is simulated as `simulated` has."""
    run = RealRun(name, name, 1, len(real.intervals), real, NONE, None, Opening())
    part = real.first(len(simulated.intervals))
    return Compared(run, model, PredictedRun(name, simulated, part, None), None)


def test_a_run_in_part_is_ranked_by_that_part() -> None:
    """A perfect simulator whose longest walk is compared in its first half: its order is perfect, as the robot's is."""
    model = Model("initial", SimpleNamespace(words="robot.toml"))  # type: ignore[arg-type]
    real = {name: walk(speed) for name, speed in {"a": 0.02, "b": 0.05, "c": 0.08, "d": 0.12}.items()}
    found = [compared(model, name, one, one.first(1) if name == "d" else one) for name, one in real.items()]
    (told,) = report_of([one.real for one in found], [model], found, None).models
    assert told.gaits == 4
    parts = {one.real.name: one.predicted.real for one in found}
    order = sorted(parts, key=lambda name: float(parts[name].p_WE[-1, 0, 0]))  # type: ignore[union-attr]
    assert order == ["a", "b", "d", "c"]  # so that the whole of d would have been another order
    assert told.srcc_com is not None
    assert np.isclose(told.srcc_com, 1.0)
