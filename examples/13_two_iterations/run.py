"""Two iterations of Real2Sim2Real on a rig whose friction, motors and tendons nobody knows, seed by seed.

`python examples/13_two_iterations/run.py --out DIR --seeds 0 1 2 3 4`; run again it goes on where it was. What
comes out and what it means: README.md beside this file.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import tomlkit

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from far import far_apart  # noqa: E402 - beside this file
from table import Row, rows_of, summary  # noqa: E402
from world import COMMAND, r2s2r, rig  # noqa: E402

from r2s2r_cli.errors import ExitCode  # noqa: E402 - what a guard that stops its robot ends with

UNKNOWN = [
    "friction,~0.5", "motor_speed_in,~0.2", "motor_speed_out,~0.2", "command_delay=0.1,0..0.5,~0.1",
    *(f"{what}.{cable},~{sd}" for what, sd in (("rest_length", 0.02), ("stiffness", 0.5)) for cable in (6, 7, 8)),
    "soft_ground.creep_m_per_ns=0.002,0..0.05,~0.005",
]  # fmt: skip
"""What this lab does not know of its robot, and therefore frees: friction, motors, passive tendons, the delay, and how
feet creep. The default set has a rate for every winch and one mass instead; all together are more than these few runs
tell, and the fit ends far off."""
# One fit of few iterations, small searches: minutes. The range over starts and the profiles say how far a fit can be
# trusted, and take as long again.
SHORT: Mapping[str, Mapping[str, object]] = {
    "identify": {"starts": 1, "profiles": 0, "max_iterations": 8, "free": UNKNOWN, "fix": ["damping_actuated=40"]},
    "plan": {"draws": 8, "doubt": 0.5, "candidates": 24, "kept": 4, "beam": 100, "cycles": 3},
}
# With few draws a policy by which one robot in ten tips over passes for safe, and repeats of it measure the tipping.
MANY_DRAWS = {**SHORT, "plan": {**SHORT["plan"], "draws": 16}}


@dataclass(frozen=True)
class Profile:
    """How much is done. targets: of the random policy of iteration 1; policies: executed in iteration 1, and those of
    iteration 2, which are others so that nothing learned from them; repeats: of every policy, they make the floor;
    settings: of project.toml, by stage; draw: pictures and pages of every stage; worlds: the first number of a world of
    a seed, where those before it are known to be none."""

    targets: int = 14
    policies: tuple[tuple[str, ...], tuple[str, ...]] = (
        ("straight", "turn-clockwise"),
        ("turn-counterclockwise", "arching"),
    )
    repeats: int = 3
    settings: Mapping[str, Mapping[str, object]] = field(default_factory=lambda: MANY_DRAWS)
    draw: bool = False
    worlds: Mapping[int, int] = field(default_factory=dict)


DEMO = Profile(policies=(("straight",), ("turn-clockwise",)), repeats=2, settings=SHORT, draw=True, worlds={2: 7})
"""Minutes instead of a quarter of an hour: `make demo`. World 7 is the first of seed 2 that is far enough: all others
look at those before it first, each as long as a look at this one."""


def prepared(
    out: Path, seed: int, profile: Profile, drawn: Callable[[Path, int], Mapping[str, object]] = far_apart
) -> Path:  # fmt: skip
    """A project with a calibrated robot, and the world that it will meet. drawn: writes truth.toml and world.toml."""
    project = out / f"seed-{seed}"
    if not (project / "calibration.h5").exists():
        shutil.rmtree(project, ignore_errors=True)
        out.mkdir(parents=True, exist_ok=True)
        r2s2r(out, "init", project.name, "--robot", "threebar")
        settings = tomlkit.parse((project / "project.toml").read_text("utf-8"))
        for stage, values in profile.settings.items():
            settings[stage].update(values)
        (project / "project.toml").write_text(tomlkit.dumps(settings), "utf-8")
        (project / "drawn.json").write_text(json.dumps(drawn(project, seed), indent=1), "utf-8")
        r2s2r(project, "rig", "--robot", "truth.toml", "--world", "world.toml", "--points", "points.csv")
        r2s2r(project, "calibrate", "--points", "points.csv", "--no-draw")
    return project


def iterate(project: Path, number: int, seed: int, profile: Profile, robot: Sequence[str]) -> None:
    """One iteration. robot: the options that name it."""
    names = [word for name in profile.policies[number - 1] for word in ("--policy", name)]
    words = ["--random", str(profile.targets), "--seed", str(seed), *names, "--repeats", str(profile.repeats), "--yes"]
    words += [] if profile.draw else ["--no-draw"]
    r2s2r(project, "run", "--iteration", str(number), *robot, *words, quiet=False)


def compared(project: Path, models: Mapping[str, Path], *, draw: bool) -> None:
    """The executed runs of both iterations beside these simulators and that of robot.toml; none named: those of both
    iterations. Kept as comparison.json."""
    words = [word for name, path in models.items() for word in ("--model", f"{name}={path}")]
    # As `run` asked for it where no simulator is named: what it compared is fresh, and told again in a second.
    command = [*COMMAND, "compare", "--iteration", "2", *words, "--json"]
    command += [] if draw else ["--no-draw"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    # Its warnings were told by the runs that are compared.
    report: dict[str, object] = json.loads(done.stdout)["report"]
    (project / "comparison.json").write_text(json.dumps(report, indent=1), "utf-8")


PAPER_STEPS = 60
"""Of Adam: the few iterations of `SHORT` are for a method of second order."""


def papers(project: Path) -> Path:
    """What the paper's preset (Adam, Key Frame Loss, mask, two parameters) learns from the same runs, in a copy."""
    other = project.parent / f"{project.name}-paper"
    found = other / "iterations" / "002" / "30-identify.h5"
    if not found.exists():
        shutil.rmtree(other, ignore_errors=True)
        first = other / "iterations" / "001"
        first.mkdir(parents=True)
        for name in ("project.toml", "robot.toml"):
            shutil.copy(project / name, other)
        for name in ("10-record.h5", "20-estimate.h5", "50-execute.h5", "51-estimate.h5"):
            (first / name).hardlink_to(project / "iterations" / "001" / name)
        (other / "iterations" / "002").mkdir()
        settings = (f"max_iterations={PAPER_STEPS}", "free=[]", "fix=[]")
        words = [word for setting in settings for word in ("--set", f"identify.{setting}")]
        r2s2r(other, "identify", "--iteration", "2", "--method", "paper", *words, "--no-draw")
    return found


def measured(project: Path, *, paper: bool, draw: bool) -> None:
    """The comparison of one seed: runs of iteration 1, from which iteration 2 learned, and new ones of iteration 2."""
    compared(project, {}, draw=draw)
    if paper:
        found = {f"iteration {n}": project / "iterations" / f"{n:03d}" / "30-identify.h5" for n in (1, 2)}
        compared(project, {**found, "the paper's preset": papers(project)}, draw=draw)


def rows_so_far(out: Path) -> list[Row]:
    """The rows of all seeds that were ever finished in `out`."""
    done = sorted(out.glob("seed-*/comparison.json"))
    return [row for path in done for row in rows_of(json.loads(path.read_text("utf-8")), path.parent.name)]


def went_through(out: Path, seed: int, profile: Profile, say: Callable[[str], None]) -> Path:
    """Both iterations of a seed, and its project. A robot that its guard stops (caps meet where tendons are too soft)
    is none to learn from: then the next world of the seed is taken, whatever it would have shown."""
    first = profile.worlds.get(seed, 0)
    while True:
        project = prepared(out, seed, profile, partial(far_apart, first=first))
        try:
            # One robot for both: its first run, and no other, begins as robot.toml says and not as a run leaves it.
            with rig(project) as robot:
                for number in (1, 2):
                    iterate(project, number, seed, profile, robot)
            return project
        except subprocess.CalledProcessError as error:
            if error.returncode != ExitCode.HARDWARE:
                raise
        world = int(json.loads((project / "drawn.json").read_text("utf-8"))["world"])
        say(f"{project.name}: the robot of world {world} was stopped by its guard; the next one")
        shutil.rmtree(project)
        first = world + 1


def main(out: Path, seeds: Sequence[int], profile: Profile, *, paper: bool, say: Callable[[str], None] = print) -> None:
    """Everything, into `out`; a seed a call will do, the table is of all that are there. say: where it goes."""
    for seed in seeds:
        project = went_through(out, seed, profile, say)
        measured(project, paper=paper, draw=profile.draw)
        told(out, seed, say)
        if profile.draw:
            say(f"look at: {project}/iterations/002/60-compare.html")


def again(out: Path, seeds: Sequence[int], *, say: Callable[[str], None] = print) -> None:
    """Only the comparisons of finished seeds, with what `compare` computes now; the paper's preset where it was run."""
    for seed in seeds:
        project = out / f"seed-{seed}"
        preset = out / f"seed-{seed}-paper" / "iterations" / "002" / "30-identify.h5"
        measured(project, paper=preset.exists(), draw=False)
        told(out, seed, say)


def told(out: Path, seed: int, say: Callable[[str], None]) -> None:
    """The table over all seeds that are there."""
    found = rows_so_far(out)
    count = len({row.seed for row in found})
    say(f"\nafter seed {seed}: " + (f"median (range) over {count} seeds" if count > 1 else "the only one so far"))
    for line in summary(found):
        say(line)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("two-iterations"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument(
        "--demo", action="store_true", help="the short profile of `make demo`, without the paper's preset"
    )
    parser.add_argument("--no-paper", action="store_true", help="without the paper's preset, a third of the time")
    parser.add_argument("--again", action="store_true", help="only the comparisons of seeds that are finished")
    given = parser.parse_args()
    if given.again:
        again(given.out.resolve(), given.seeds)
    else:
        main(
            given.out.resolve(),
            given.seeds,
            DEMO if given.demo else Profile(),
            paper=not (given.demo or given.no_paper),
        )
