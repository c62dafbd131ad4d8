"""`r2s2r bench engine`: this engine and MuJoCo on one robot, gait and step, measured in turn in one process."""

from __future__ import annotations

import json as jsonlib
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import NumericalError, UsageError, require_mujoco
from r2s2r_cli.options import JsonOption, QuietOption
from schemas.results_bench import Comparison, EngineBenchResult

if TYPE_CHECKING:
    from r2s2r_cli.commands.bench_probe import Plan
    from r2s2r_cli.commands.bench_sides import MujocoSide, OurSide

RUN_S, QUICK_RUN_S = 10.0, 4.0
BATCHES, QUICK_BATCHES = ((64, 1.0), (1024, 0.2)), ((64, 0.5), (1024, 0.1))
"""Environments, and seconds that each is simulated."""


class MujocoIntegrator(StrEnum):
    """What `--integrator` takes."""

    EULER = "Euler"
    IMPLICITFAST = "implicitfast"


def engine(
    robot: Annotated[str, typer.Option("--robot", help="One of the robots that `init` knows.")] = "threebar",
    step: Annotated[float, typer.Option("--step", min=1e-5, max=0.02, help="Step of both [s].")] = 0.001,
    integrator: Annotated[
        MujocoIntegrator, typer.Option("--integrator", help="MuJoCo's; implicitfast brakes falling robots.")
    ] = MujocoIntegrator.EULER,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Turns of each pair; the best counts.")] = 5,
    quick: Annotated[bool, typer.Option("--quick", help="Short runs, twice: a look, no measurement.")] = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Time the engine and MuJoCo on the same robot, gait and step: forward, in batches, and a gradient.

    Processor time of one core. The gradient is that of one number along 10 s with respect to ten parameters: a forward
    and a backward pass here, eleven rollouts for MuJoCo, which give the Jacobian of everything too; here that is one
    pass with ten tangents, and timed beside it. Needs the extra `rig`.

    Example: r2s2r bench engine --quick
    """
    from r2s2r_cli.commands.bench_probe import Plan

    console = Console(json=json, quiet=quiet)
    require_mujoco("bench engine")
    ticks = 0.02 / step
    if abs(ticks - round(ticks)) > 1e-9:
        raise UsageError("motor commands change every 20 ms", where="--step", received=f"{step:g} s",
                         expected="20 ms divided by a whole number",
                         hint="r2s2r bench engine --step 0.001")  # fmt: skip
    turns = min(repeats, 2) if quick else repeats
    with tempfile.TemporaryDirectory() as cache:
        lengths = (QUICK_RUN_S, QUICK_BATCHES) if quick else (RUN_S, BATCHES)
        plan = Plan(robot, step, *lengths, integrator=integrator.value, cache_dir=cache)
        plan.load()
        result = _measured(plan, turns, quick, console)
    console.document(result)
    _print(result, console)


def _measured(plan: Plan, turns: int, quick: bool, console: Console) -> EngineBenchResult:
    from importlib.metadata import version

    from r2s2r_cli.commands import bench_gait
    from r2s2r_cli.commands.bench_sides import MujocoSide, OurSide

    with console.progress("engine and MuJoCo", 3 + turns * 10) as advance:
        cold = _probed("ours", plan)
        advance(1)
        cached = _probed("ours", plan)
        advance(1)
        foreign = _probed("mujoco", plan)
        advance(1)
        robot = plan.load()
        ours, mujoco = OurSide(robot, plan.step_s), MujocoSide(robot, plan.step_s, plan.integrator)
        u = bench_gait.commands(robot, ours.speed, plan.run_s, range(1))
        batches = ((1, plan.run_s), *plan.batches)
        forward = [_forward(ours, mujoco, plan, n, length, turns, advance) for n, length in batches]
        gradient = _compared(
            ours.gradient(u), mujoco.gradient(u), turns, advance, steps=None,
            what=f"gradient of one number over {plan.run_s:g} s, {len(bench_gait.parameters())} parameters",
        )  # fmt: skip
        jacobian = _compared(
            ours.jacobian(u), mujoco.gradient(u), turns, advance, steps=None,
            what=f"Jacobian of the end caps over {plan.run_s:g} s, {len(bench_gait.parameters())} parameters",
        )  # fmt: skip
    options = mujoco.options
    return EngineBenchResult(
        machine=machine(), versions={name: version(name) for name in ("mujoco", "torch", "llvmlite", "numpy")},
        robot=plan.robot, quick=quick, repeats=turns, step_s=plan.step_s, substeps=ours.substeps,
        mujoco_options=f"{options.integrator}, {options.cone} cone, rod contact, mujoco.rollout with one thread",
        forward_1=forward[0], forward_64=forward[1], forward_1024=forward[2], gradient_10=gradient,
        gradient_run_s=plan.run_s, parameters=bench_gait.parameters(), jacobian_10=jacobian,
        compile_s=cold["seconds"]["forward"] + cold["seconds"]["backward"], compile_parts_s=cold["seconds"],
        cached_start_s=cached["seconds"]["forward"] + cached["seconds"]["backward"],
        peak_memory_bytes={"ours": cached["peak"], "mujoco": foreign["peak"]},
    )  # fmt: skip


def _forward(
    ours: OurSide, mujoco: MujocoSide, plan: Plan, n: int, length: float, turns: int, advance: Callable[[int], None]
) -> Comparison:
    from r2s2r_cli.commands import bench_gait

    u = bench_gait.commands(ours.robot, ours.speed, length, range(n))
    what = f"{n} environment{'s' * (n > 1)}, {length:g} s each"
    return _compared(
        ours.forward(u), mujoco.forward(u), turns, advance, steps=n * round(length / plan.step_s), what=what
    )


def _compared(
    ours: Callable[[], None], mujoco: Callable[[], None], turns: int, advance: Callable[[int], None], *,
    steps: int | None, what: str,
) -> Comparison:  # fmt: skip
    """Both in turn, so that what else the machine does meets both; once each without a clock before."""
    ours()
    mujoco()
    times = []
    for _ in range(turns):
        times.append((_cpu(ours), _cpu(mujoco)))
        advance(2)
    best = [min(column) for column in zip(*times, strict=True)]
    ratios = sorted(theirs / own for own, theirs in times)
    unit: Literal["s", "steps/s"] = "s" if steps is None else "steps/s"
    values = best if steps is None else [steps / seconds for seconds in best]
    return Comparison(ours=values[0], mujoco=values[1], unit=unit, ratio=best[1] / best[0],
                      spread=(ratios[0], ratios[-1]), what=what)  # fmt: skip


def _cpu(job: Callable[[], None]) -> float:
    clock = time.process_time()
    job()
    return time.process_time() - clock


def _probed(side: str, plan: Plan) -> dict[str, Any]:
    command = [sys.executable, "-m", "r2s2r_cli.commands.bench_probe", side, jsonlib.dumps(asdict(plan))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NumericalError(f"the process that starts {side} afresh ended early", where="bench engine",
                             expected="exit code 0", received=(done.stderr.strip().splitlines() or ["no message"])[-1],
                             hint="r2s2r doctor")  # fmt: skip
    found: dict[str, Any] = jsonlib.loads(done.stdout.splitlines()[-1])
    return found


def machine() -> str:
    """Processor, cores and Python, in words."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as file:  # noqa: PTH123  not a file of ours
            name = next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{name}, {os.cpu_count()} cores, python {platform.python_version()}"


def _print(result: EngineBenchResult, console: Console) -> None:
    rows = []
    for name in ("forward_1", "forward_64", "forward_1024", "gradient_10", "jacobian_10"):
        c: Comparison = getattr(result, name)
        low, high = c.spread
        rows.append([name, c.what, _number(c.ours, c.unit), _number(c.mujoco, c.unit), f"{c.ratio:.1f}x",
                     f"{low:.1f} to {high:.1f}"])  # fmt: skip
    title = f"{result.robot}, steps of {result.step_s * 1e3:g} ms, processor time of one core ({result.machine})"
    console.table(title, ["", "what", "ours", "MuJoCo", "ratio", "spread"], rows)
    memory = ", ".join(f"{name} {size / 2**20:.0f} MiB" for name, size in result.peak_memory_bytes.items())
    parts = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in result.compile_parts_s.items())
    console.data(
        f"first call, forward and backward: {result.compile_s:.2f} s; from the cache {result.cached_start_s:.2f} s"
    )
    console.data(f"first calls by kind: {parts}")
    console.data(f"peak memory: {memory}")
    console.say(f"MuJoCo {result.versions['mujoco']}: {result.mujoco_options}")
    if result.quick:
        console.say("--quick: short runs, no measurement")


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} s" if unit == "s" else f"{value:,.0f} steps/s"
