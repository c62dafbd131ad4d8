"""The paper's synthetic identification: a short version of the example."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import torch

from r2s2r_cli.stages.identify.paper import Loss, Settings, identify_paper
from tests.examples.load import load
from tests.support.soak import drawn

task = load("08_paper_identification", "task")
gradients = load("08_paper_identification", "gradients")
run = load("08_paper_identification", "run")


@pytest.mark.slow
def test_fits_side_by_side_are_those_of_the_library() -> None:
    """Adam on a batch of fits: each has the values that `identify_paper` gives it alone."""
    torch.set_num_threads(1)
    made = task.engine(free="motor_speed=0.5,0.1..1.5")
    one = task.task(made, 0, 2)
    both = task.descend(one, [Loss.KEY_FRAME, Loss.LAST_STEP], [0.5, 0.5], 1)
    assert both.losses == pytest.approx(0.0, abs=1e-12)
    other = task.engine(free="motor_speed=0.8,0.1..1.5")
    fits = task.descend(one, [Loss.ALL_STEP, Loss.KEY_FRAME], [0.3, 0.8], 5)
    alone = identify_paper(other.world, other.numbers, [one.demo], [one.start], Settings(Loss.KEY_FRAME, iterations=5))
    assert fits.speeds[:, 1] == pytest.approx(alone.trace.values[:, 0], abs=1e-6)
    assert fits.losses[:, 1] == pytest.approx(alone.trace.losses, rel=1e-3)


@pytest.mark.slow
def test_the_key_frame_loss_converges_from_both_sides() -> None:
    """A policy of the page (two in a soak test), motor speed from 0.8 and 0.3: in the last third of sixty iterations
    three in four fits stay within 10 % of 0.5. (Not all: where a robot nearly tips over, last bits decide.)"""
    torch.set_num_threads(1)
    made, seeds = task.engine(), drawn((2,), (0, 2))
    fits = [task.descend(task.task(made, seed, 4), [Loss.KEY_FRAME] * 2, list(run.FIRSTS), 60) for seed in seeds]
    speeds = np.concatenate([fit.speeds[-20:] for fit in fits], axis=1)
    away = np.abs(speeds - task.TRUTH).max(axis=0)
    assert np.mean(away < run.NEAR) >= 0.75


def test_tables_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Flat curves at the truth have converged; curves that wander have not."""
    flat, wander = np.full((30, 10), 0.5), np.tile(np.linspace(0.3, 1.2, 30)[:, None], 10)
    losses = np.full((30, 10), 1e-6)
    run.print_table([task.Descent(losses, flat)])
    run.print_table([task.Descent(losses, wander)])
    assert re.findall(r"(\d+) of 2 ", capsys.readouterr().out) == ["2"] * 5 + ["0"] * 5
    run.figure(tmp_path / "x.png", [task.Descent(losses, flat)])
    assert (tmp_path / "x.png").stat().st_size > 5_000
