"""What pruning costs the gait search: `python docs/concepts/gait_search_regret.py --beam 200 --merge 0.006`.

Searches gaits of a robot with that beam and that size of classes (0 and 0: the exhaustive search, some five minutes of
processor time at depth 4) and prints the highest reward of every behaviour,
simulated, and what it took.
"""

from __future__ import annotations

import argparse
import sys
import time
import tomllib

import numpy as np

from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.plan.belief import assumed
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import run_gaits
from r2s2r_cli.stages.plan.placement import reference_of
from r2s2r_cli.stages.plan.rewards import BEHAVIOURS
from r2s2r_cli.stages.plan.search import Search, SearchSettings, best_of
from r2s2r_cli.stages.plan.symmetry import symmetry_group
from schemas.robot import Robot

SHORTLIST = 60
"""Gaits of each behaviour that are simulated by themselves: what is told of a class is not exact."""


def main(beam: int, merge_m: float, depth: int, name: str, most_changed: int) -> None:
    """Search and say."""
    robot = Robot.model_validate(tomllib.loads(robot_toml(name)))
    belief = assumed(robot)
    executor = Executor(robot, belief, belief.draws(1, np.random.default_rng(0)), step=1e-3, hurried=True)
    start = executor.standing(np.array(robot.rest_caps_m)[None], np.zeros(1, dtype=int))
    reference = reference_of(executor.caps(start)[0], symmetry_group(robot))
    settings = SearchSettings(depth=depth, beam=beam, merge_m=merge_m, most_changed=most_changed)
    clock = time.process_time()
    found = Search(executor, reference, start, BEHAVIOURS, settings).found()
    spent = time.process_time() - clock
    lines = [
        f"{found.simulated} targets, {found.lost} given up, {len(found.gaits)} gaits, {spent:.0f} s processor time"
    ]
    for behaviour, reward in BEHAVIOURS.items():
        gaits = [found.gaits[row] for row in best_of(found, reward, SHORTLIST)]
        came, sound = run_gaits(executor, reference, start, gaits, np.zeros(len(gaits), dtype=int))
        value = np.where(sound & (came.error < settings.rest_error_m), reward(came), -np.inf)
        best = int(value.argmax())
        lines.append(f"{behaviour:17} {value[best]:.3f}  {' '.join(gaits[best].key)}")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--beam", type=int, default=200)
    parser.add_argument("--merge", type=float, default=0.006)
    parser.add_argument("--depth", type=int, default=4)
    parser.add_argument("--robot", default="threebar")
    parser.add_argument("--most-changed", type=int, default=6)
    given = parser.parse_args()
    main(given.beam, given.merge, given.depth, given.robot, given.most_changed)
