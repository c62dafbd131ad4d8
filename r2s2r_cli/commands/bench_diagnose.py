"""`r2s2r bench diagnose`: how long one diagnosis of five gaits with the whole catalogue takes on this machine."""

from __future__ import annotations

import os
import platform
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.options import JsonOption, QuietOption
from schemas.results_bench import DiagnoseBenchResult
from schemas.robot import Robot

EFFECT = {"motor_lag.tau_s": 0.15}
BUDGET_S = 30.0
"""For five gaits and the whole catalogue, on two cores."""


def diagnose(
    gaits: Annotated[int, typer.Option("--gaits", min=3, max=20, help="Gaits of five targets each.")] = 5,
    threads: Annotated[int, typer.Option("--threads", min=1, max=64, help="Threads of the engine.")] = 2,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Time one diagnosis: gaits of the engine's own making with a motor lag, every effect considered.

    The machine code is compiled first and counted apart: it is kept from then on. Says as well whether the lag was
    named; that is a check of the algorithm, not of its accuracy.

    Example: r2s2r bench diagnose
    """
    from r2s2r_cli.commands.interrupts import loaded

    console = Console(json=json, quiet=quiet)
    stage = loaded("r2s2r_cli.stages.diagnose.diagnose")
    sample = loaded("r2s2r_cli.stages.diagnose.sample")
    robots = loaded("r2s2r_cli.stages.init.robots")
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder)
        begun = time.perf_counter()
        robot = Robot.model_validate(tomllib.loads(robots.robot_toml("threebar")))
        evidence = sample.planted(robot, EFFECT, gaits=gaits, seed=1, cache_dir=cache, threads=threads)
        seconds: dict[str, float] = {}
        settings = stage.Settings(with_where=True)
        with console.progress("compile", 1) as advance:
            stage.diagnose(evidence, settings, cache_dir=cache, threads=threads)
            advance(1)
        compiled = time.perf_counter() - begun
        begun, cpu = time.perf_counter(), time.process_time()
        at: list[tuple[str, float]] = []

        def told(part: str, done: int, total: int) -> None:
            del done, total
            now = time.perf_counter()
            if at:
                seconds[at[-1][0]] = seconds.get(at[-1][0], 0.0) + now - at[-1][1]
            at.append((part, now))

        found = stage.diagnose(evidence, settings, told, cache_dir=cache, threads=threads)
        told("end", 0, 1)
        wall, cpu = time.perf_counter() - begun, time.process_time() - cpu
    robot_s = sum(float(run.caps.t[-1] - run.caps.t[0]) for run in evidence.runs)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, python {platform.python_version()}"
    result = DiagnoseBenchResult(
        machine=machine, gaits=gaits, robot_s=robot_s, threads=threads, first_s=compiled, wall_s=wall, cpu_s=cpu,
        seconds=seconds, rollouts=found.rollouts, verdict=found.which.verdict, effects=found.which.effects,
    )  # fmt: skip
    console.document(result)
    console.table(
        f"one diagnosis of {gaits} gaits, {robot_s:.0f} s of the robot, the whole catalogue ({machine})",
        ["part", "time"],
        [*([part, f"{s:.1f} s"] for part, s in seconds.items()), ["all", f"{wall:.1f} s"],
         ["processor", f"{cpu:.1f} s"],
         ["rate", f"{found.rollouts / wall:.0f} simulated stretches a second ({found.rollouts})"],
         ["first time, machine code compiled", f"{compiled:.1f} s"]],
    )  # fmt: skip
    console.say(f"budget {BUDGET_S:g} s for 5 gaits on 2 cores: " + ("kept" if wall <= BUDGET_S else "exceeded"))
    console.say(" ".join(["verdict:", found.which.verdict, *found.which.effects]))
