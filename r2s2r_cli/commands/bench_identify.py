"""`r2s2r bench identify`: our fit and `mujoco.sysid` on the same synthetic problem, in turn in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import NumericalError, UsageError, install_extra
from r2s2r_cli.options import JsonOption, QuietOption
from schemas.results_bench import IdentifiedBy, IdentifiedCase, IdentifyBenchResult, Share

if TYPE_CHECKING:
    from r2s2r_cli.commands.bench_identify_case import Case, Fit
    from r2s2r_cli.stages.identify.predict import Predictor
    from schemas.robot import Robot

SEEDS = 2
"""Cases beside mujoco.sysid by default: it takes a quarter of a minute for each, twice."""
STEP_MS = 2.0
"""Of both simulators, so that they do the same work: the one that `mujoco.sysid` was measured with elsewhere."""
OWN_STEP_MS = 1.0
"""Of ours where it is alone: that of `identify`."""
FEW = 5
"""Up to so many cases are shown one by one."""
MANY = 20
"""From so many on a share has an interval worth printing."""
OURS, DEFAULTS, SCALED, GROWING = "ours", "mujoco.sysid", "mujoco.sysid jac", "mujoco.sysid growing"
_WHAT = {
    OURS: "identify",
    DEFAULTS: "its defaults",
    SCALED: "x_scale='jac'",
    GROWING: "x_scale='jac', growing horizon",
}


def identify(
    robot: Annotated[str, typer.Option("--robot", help="One of the robots that `init` knows.")] = "threebar",
    seeds: Annotated[
        int | None, typer.Option("--seeds", min=1, help=f"Cases for both tools; {SEEDS} by default.")
    ] = None,
    cases: Annotated[
        int | None, typer.Option("--cases", min=1, help="So many cases for ours alone; needs no MuJoCo.")
    ] = None,
    hard: Annotated[
        bool, typer.Option("--hard", help="With --cases: attachment phases and initial velocities unknown too.")
    ] = False,
    growing: Annotated[
        bool, typer.Option("--growing", help="mujoco.sysid with a growing horizon of our making, too: a minute each.")
    ] = False,
    seconds: Annotated[int, typer.Option("--seconds", min=2, max=60, help="Length of each gait [s].")] = 10,
    step: Annotated[
        float | None,
        typer.Option(
            "--step",
            min=0.25,
            max=4.0,
            help=f"Step of both simulators [ms]; {STEP_MS:g}, or {OWN_STEP_MS:g} with --cases.",
        ),
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Plant five numbers in a robot, and see who finds them: our fit and mujoco.sysid, in processor time.

    A random binary gait, end caps at 20 Hz with 1 mm of noise, starts 15 to 50 % off, first state known. Each tool gets
    data of its own simulator, so that neither is judged by how the two differ, and both take the same step. Needs the
    extra `rig`, with --cases not.

    Example: r2s2r bench identify --cases 10
    """
    console = Console(json=json, quiet=quiet)
    if hard and cases is None:
        raise UsageError("--hard is for ours alone: a fit of mujoco.sysid has no initial velocities to free",
                         where="--hard", expected="--cases N --hard", received="--hard alone",
                         hint="r2s2r bench identify --cases 10 --hard")  # fmt: skip
    if growing and cases is not None:
        raise UsageError("--growing is for mujoco.sysid, which --cases leaves out",
                         where="--growing", expected="--growing without --cases", received="both",
                         hint="r2s2r bench identify --growing")  # fmt: skip
    if seeds is not None and cases is not None:
        raise UsageError("--cases says how many cases there are, for ours alone; --seeds the same for both tools",
                         where="--seeds", expected="one of the two", received="both",
                         hint=f"r2s2r bench identify --cases {cases}")  # fmt: skip
    theirs = () if cases is not None else (DEFAULTS, SCALED, *((GROWING,) if growing else ()))
    if theirs:
        _require_sysid()
    step_ms = step or (STEP_MS if theirs else OWN_STEP_MS)
    result = _measured(robot, range(cases or seeds or SEEDS), theirs, hard, seconds, 1e-3 * step_ms, console)
    console.document(result)
    _print(result, console)


def _require_sysid() -> None:
    try:
        from mujoco import sysid

        found = hasattr(sysid, "optimize")  # without its extra the module is there, and empty
    except ImportError:
        found = False
    if not found:
        raise UsageError(
            "mujoco.sysid is not installed", where="bench identify", expected="mujoco[sysid] of the extra `rig`",
            received="none", hint=install_extra("rig") + "   # without it: r2s2r bench identify --cases 10",
        )  # fmt: skip


def _measured(
    name: str, seeds: Iterable[int], theirs: tuple[str, ...], hard: bool, seconds: int, step: float, console: Console
) -> IdentifyBenchResult:
    import tomllib
    from importlib.metadata import version

    from r2s2r_cli.commands.bench_engine import machine
    from r2s2r_cli.commands.bench_identify_case import FRAME_S, NOISE_M, make_case
    from r2s2r_cli.commands.bench_identify_ours import predictor_of
    from r2s2r_cli.commands.bench_identify_tally import summed_up
    from r2s2r_cli.stages.init.robots import robot_toml
    from schemas.robot import Robot

    robot = Robot.model_validate(tomllib.loads(robot_toml(name)))
    seeds = list(seeds)
    found: dict[str, list[IdentifiedCase]] = {tool: [] for tool in (OURS, *theirs)}
    with console.progress("identify", len(seeds) * len(found) + 1) as advance:
        predictor = predictor_of(robot, hard=hard, step=step)
        compile_s = _compiled(robot, predictor)
        advance(1)
        for seed in seeds:
            case = make_case(robot, seed, run_s=float(seconds))
            for tool in found:
                found[tool].append(_one(tool, case, predictor))
                advance(1)
    ours_cpu_s = [max(one.cpu_s, 1e-9) for one in found[OURS]]
    packages = ("torch", "llvmlite", "numpy", *(("mujoco",) if theirs else ()))
    frees = predictor.mapping.frees
    return IdentifyBenchResult(
        machine=machine(), versions={package: version(package) for package in packages}, robot=name,
        run_s=float(seconds), step_s={"ours": step, **({"mujoco": step} if theirs else {})},
        noise_mm=1e3 * NOISE_M, frames_per_s=1.0 / FRAME_S, hard=hard, parameters=tuple(free.name for free in frees),
        units=tuple(free.unit for free in frees),
        tools={tool: summed_up(_WHAT[tool], cases, ours_cpu_s) for tool, cases in found.items()}, compile_s=compile_s,
    )  # fmt: skip


def _compiled(robot: Robot, predictor: Predictor) -> float:
    """Processor time until everything that a fit calls has been called once, on a short case."""
    from r2s2r_cli.commands.bench_identify_case import make_case
    from r2s2r_cli.commands.bench_identify_ours import OurSide

    clock = time.process_time()
    OurSide(make_case(robot, 0, run_s=1.0), predictor).fit()
    return time.process_time() - clock


def _one(tool: str, case: Case, predictor: Predictor) -> IdentifiedCase:
    from r2s2r_cli.commands.bench_identify_tally import judged

    if tool == OURS:
        from r2s2r_cli.commands.bench_identify_ours import OurSide

        ours = OurSide(case, predictor)
        return judged(case, ours.truth, *_tried(ours.fit))
    from r2s2r_cli.commands.bench_identify_mujoco import SysidSide

    side = SysidSide(case, predictor.step)
    fits: dict[str, Callable[[], Fit]] = {
        DEFAULTS: side.fit,
        SCALED: lambda: side.fit(x_scale="jac"),
        GROWING: lambda: side.fit_growing(x_scale="jac"),
    }
    return judged(case, case.truth, *_tried(fits[tool]))


def _tried(fit: Callable[[], Fit]) -> tuple[Fit | str, float]:
    """The fit, or why there is none, and the processor time until then [s]: a tool that fails in one case goes on to
    the next, and has spent time all the same."""
    clock = time.process_time()
    try:
        found: Fit | str = fit()
    except (NumericalError, ArithmeticError, ValueError) as error:
        found = (str(error).splitlines() or [type(error).__name__])[0]
    return found, time.process_time() - clock


def _print(result: IdentifyBenchResult, console: Console) -> None:
    rows = [
        [tool, f"{by.cpu_median_s:.2f} s", f"{by.cpu_median_ratio:.1f}x", f"{by.cpu_ratio:.1f}x", _of(by.solved),
         f"{100 * by.error_median:.2g} %", _of(by.covered), f"{by.without_interval}", _rms(by)]
        for tool, by in result.tools.items()
    ]  # fmt: skip
    console.table(
        f"{result.robot}, {len(result.parameters)} numbers, {result.run_s:g} s of gait at {result.frames_per_s:g} Hz, "
        f"noise {result.noise_mm:g} mm, steps of {1e3 * result.step_s['ours']:g} ms ({result.machine})",
        ["tool", "processor, median", "to ours, median", "in all", "solved", "error, median", "in its 95 % interval",
         "no interval", "residual, median"],
        rows,
    )  # fmt: skip
    for tool, by in result.tools.items():
        if len(by.cases) <= FEW:
            title = f"{tool}, {by.what}: estimate (95 % interval) as a share of the planted value"
            console.table(title, ["seed", *result.parameters], [_row(one) for one in by.cases])
        for one in by.cases:
            if one.failed:
                console.warn(f"{tool}, seed {one.seed}: {one.failed}")
    console.say("solved: every value within the larger of 2 % and 3 reported standard deviations of its planted value")
    console.say(f"our first calls, compilation included, {result.compile_s:.1f} s, are not in the times")


def _of(share: Share) -> str:
    known = f" ({100 * share.low:.0f} to {100 * share.high:.0f} %)" if share.total >= MANY else ""
    return f"{share.count} of {share.total}{known}"


def _rms(by: IdentifiedBy) -> str:
    """Of the fits that there are: one that failed leaves nothing to look at, and not nothing."""
    from statistics import median

    left = [one.rms_mm for one in by.cases if not one.failed]
    return f"{median(left):.2f} mm" if left else "none"


def _row(one: IdentifiedCase) -> list[str]:
    return [f"{one.seed}", *map(_cell, one.truth, one.start, one.estimate, one.low, one.high)]


def _cell(truth: float, start: float, estimate: float, low: float | None, high: float | None) -> str:
    unit = truth if start != 0 else 1.0  # attachment phases start at 0, and are shown in rad
    interval = "none" if low is None or high is None else f"{low / unit:.3f} to {high / unit:.3f}"
    return f"{estimate / unit:.3f} ({interval})"
