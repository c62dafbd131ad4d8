"""`r2s2r bench estimate`: the camera tracker on runs of the rig whose truth only the scorer knows."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import R2S2RError, UsageError, require_mujoco
from r2s2r_cli.options import JsonOption, QuietOption

if TYPE_CHECKING:
    from r2s2r_cli.commands.bench_estimate_case import Case
    from r2s2r_cli.commands.bench_estimate_score import Errors
    from schemas.results_estimate_bench import EstimateBenchResult, TrackScore

SEEDS = 2
"""Runs of each case by default; the figures of the documentation are those of ten."""
_PAGE = 4096
_PACKAGES = ("numpy", "scipy", "opencv-python-headless", "mujoco")


def estimate(
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=10, help="Runs of each case.")] = SEEDS,
    case: Annotated[list[str] | None, typer.Option("--case", help="Only this case; may be given again.")] = None,
    seconds: Annotated[float, typer.Option("--seconds", min=4, max=3600, help="Length of each run [s].")] = 20.0,
    tuning: Annotated[
        bool, typer.Option("--tuning", help="The seeds that the tracker was tuned on, not those of the figures.")
    ] = False,
    robot: Annotated[str, typer.Option("--robot", help="One of the robots that `init` knows.")] = "threebar",
    keep: Annotated[
        Path | None, typer.Option("--keep", help="Folder for the drawn pictures; used again the next time.")
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Track the rig's robot under the rig's camera, and compare with where it really was. Needs the extra `rig`.

    Random gaits in closed loop, 30 pictures a second; the tracker gets pictures and sensors, only the scorer the truth.
    Cases differ in camera height, what is hidden, and how bad the sensors are. Drawing takes longer than tracking.

    Example: r2s2r bench estimate --case "1.44 m" --seeds 1
    """
    from r2s2r_cli.commands.bench_estimate_case import REPORT_SEEDS, SETTINGS, TUNING_SEEDS

    console = Console(json=json, quiet=quiet)
    require_mujoco("bench estimate")
    names = case or list(SETTINGS)
    unknown = [name for name in names if name not in SETTINGS]
    if unknown:
        raise UsageError(
            f"there is no case {unknown[0]}", where="--case", expected=", ".join(SETTINGS), received=unknown[0],
            hint='r2s2r bench estimate --case "1.44 m"',
        )  # fmt: skip
    chosen = list(TUNING_SEEDS if tuning else REPORT_SEEDS)[:seeds]
    result = _measured(names, chosen, seconds, robot, keep, console)
    console.document(result)
    _print(result, console)


def _measured(
    names: Sequence[str], seeds: Sequence[int], run_s: float, robot: str, keep: Path | None, console: Console
) -> EstimateBenchResult:
    import tempfile
    from dataclasses import asdict
    from importlib.metadata import version

    from r2s2r_cli.commands.bench_engine import machine
    from r2s2r_cli.commands.bench_estimate_case import SETTINGS, make_case
    from r2s2r_cli.commands.bench_estimate_score import summed_up
    from schemas.results_estimate_bench import EstimateBenchCase, EstimateBenchResult, TrackedCase

    cases: dict[str, EstimateBenchCase] = {}
    with console.progress("estimate", len(names) * len(seeds)) as advance:
        for name in names:
            errors: list[Errors] = []
            failed: list[int] = []
            runs: list[TrackedCase] = []
            for seed in seeds:
                with tempfile.TemporaryDirectory(prefix="r2s2r-bench-") as folder:
                    made = make_case(seed, keep or Path(folder), run_s=run_s, robot=robot, **asdict(SETTINGS[name]))
                    found = _tracked(made)
                if isinstance(found, str):
                    failed.append(len(made.frames))
                    runs.append(TrackedCase(seed=seed, score=None, failed=found))
                else:
                    errors.append(found)
                    runs.append(TrackedCase(seed=seed, score=summed_up([found])))
                advance(1)
            both = summed_up(errors, failed) if errors else None
            cases[name] = EstimateBenchCase(setting=asdict(SETTINGS[name]), all=both, runs=tuple(runs))
    return EstimateBenchResult(
        machine=machine(), versions={name: version(name) for name in _PACKAGES},
        robot=robot, run_s=run_s, seeds=tuple(seeds), cases=cases,
    )  # fmt: skip


def _tracked(case: Case) -> Errors | str:
    """Errors of one run, or why it could not be tracked: one that fails must not end the others."""
    from r2s2r_cli.commands.bench_estimate_score import errors_of
    from r2s2r_cli.stages.estimate.camera_run import tracked_run
    from r2s2r_cli.stages.estimate.groups import run_groups
    from schemas.estimate import EstimateSettings

    before = most = _resident_mb()

    def watch(part: str, done: int, total: int, word: str) -> None:
        nonlocal most
        del part, done, total, word
        most = max(most, _resident_mb())

    clock, busy = time.perf_counter(), time.process_time()
    try:
        state = tracked_run("case", case.streams, case.frames, case.robot, EstimateSettings(), show=watch)
    except R2S2RError as error:
        return str(error).splitlines()[0]
    wall, busy = time.perf_counter() - clock, time.process_time() - busy
    root = "runs/case"
    groups = {path[len(root) + 1 :]: group for path, group in run_groups(state).items()}
    return errors_of(case, groups, wall_s=wall, cpu_s=busy, memory_mb=most - before)


def _resident_mb() -> float:
    """Memory of this process [MB]; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE / 1e6
    except OSError:
        return 0.0


def _print(result: EstimateBenchResult, console: Console) -> None:
    console.table(
        f"{result.robot}, runs of {result.run_s:g} s, seeds {', '.join(map(str, result.seeds))} ({result.machine})",
        ["case", "cap mean / p95 / max mm", "rod mm", "axis deg (p95)", "2 cm 5 deg", "CoM mm", "in 95 %", "lost",
         "contact F1", "delay ms", "sensor mm", "floor mm", "back s", "frames/s", "CPU ms", "MB"],
        [[name, *_row(case.all_)] for name, case in result.cases.items()],
    )  # fmt: skip
    for name, case in result.cases.items():
        for run in case.runs:
            if run.failed:
                console.warn(f"{name}, seed {run.seed}: {run.failed}")
    console.say(
        "in 95 %: share of errors inside the 95 % ellipsoid that the estimate states; heights and tilt of the floor "
        "count, x, y and heading of the world are a choice; runs that failed count as lost"
    )


def _row(score: TrackScore | None) -> list[str]:
    if score is None:
        return ["failed", *[""] * 14]
    return [
        f"{score.cap_mean_mm:.2f} / {score.cap_p95_mm:.1f} / {score.cap_max_mm:.0f}", f"{score.rod_mean_mm:.2f}",
        f"{score.axis_mean_deg:.2f} ({score.axis_p95_deg:.2f})", f"{100 * score.within:.2f} %",
        f"{score.com_mean_mm:.2f}", f"{100 * score.covered:.1f} %", f"{100 * score.lost:.1f} %",
        _number(score.contact_f1, 3), _delay(score), _number(score.sensor_error_mm, 2), f"{score.floor_mm:.2f}",
        _number(score.recovery_s, 2), f"{score.frames_per_s:.1f}", f"{score.cpu_ms:.0f}",
        f"{score.memory_mb:.0f}",
    ]  # fmt: skip


def _delay(score: TrackScore) -> str:
    """Largest error, and in how many runs with sensors the estimate does not know the delay."""
    known = _number(score.delay_error_ms, 1)
    return f"{known} ({score.delay_unknown} unknown)".strip() if score.delay_unknown else known


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
