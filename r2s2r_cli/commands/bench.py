"""`r2s2r bench`: speeds on this machine, as ratios measured in one run: start-up, engine, tracker, identification."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from typing import Annotated

import typer

from r2s2r_cli.commands.bench_diagnose import diagnose
from r2s2r_cli.commands.bench_engine import engine
from r2s2r_cli.commands.bench_estimate import estimate
from r2s2r_cli.commands.bench_identify import identify
from r2s2r_cli.console import Console
from r2s2r_cli.options import JsonOption, QuietOption
from schemas.results import BenchResult

bench_app = typer.Typer(help="Measure speeds on this machine.", no_args_is_help=True)

BUDGET_S = 0.5
"""What help and light commands may take."""
_BARE = "python -c pass"
_MEASURED = {
    _BARE: ["-c", "pass"],
    "r2s2r --help": ["-m", "r2s2r_cli", "--help"],
    "r2s2r --version": ["-m", "r2s2r_cli", "--version"],
    "r2s2r status --help": ["-m", "r2s2r_cli", "status", "--help"],
    "r2s2r doctor --quick": ["-m", "r2s2r_cli", "doctor", "--quick"],
}


@bench_app.callback()
def bench() -> None:
    """Measure speeds on this machine, as ratios within one run.

    Example: r2s2r bench startup
    """


bench_app.command("engine")(engine)
bench_app.command("estimate")(estimate)
bench_app.command("identify")(identify)
bench_app.command("diagnose")(diagnose)


@bench_app.command("startup")
def startup(
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Fresh processes per command.")] = 7,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Time help and light commands in fresh processes, beside a bare interpreter.

    Example: r2s2r bench startup --repeats 5
    """
    console = Console(json=json, quiet=quiet)
    seconds: dict[str, float] = {}
    with console.progress("start-up", repeats * len(_MEASURED)) as advance:
        for name, arguments in _MEASURED.items():
            times = []
            for _ in range(repeats):
                times.append(_time(arguments))
                advance(1)
            seconds[name] = sorted(times)[len(times) // 2]
    ratios = {name: value / seconds[_BARE] for name, value in seconds.items()}
    machine = f"{platform.machine()}, {os.cpu_count()} cores, python {platform.python_version()}"
    console.document(BenchResult(machine=machine, repeats=repeats, seconds=seconds, ratio_to_python=ratios))
    rows = [[name, f"{value:.3f} s", f"{ratios[name]:.1f}x"] for name, value in seconds.items()]
    console.table(f"start-up, median of {repeats} ({machine})", ["command", "time", "to bare python"], rows)
    slow = [name for name, value in seconds.items() if value > BUDGET_S]
    console.say(f"budget {BUDGET_S} s: " + (f"exceeded by {', '.join(slow)}" if slow else "kept"))


def _time(arguments: list[str]) -> float:
    clock = time.perf_counter()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    return time.perf_counter() - clock
