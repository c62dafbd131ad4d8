"""The paper's unexplained turning, on a floor that is not the same everywhere: friction refitted, and the cause found.

`python examples/16_uneven_floor/uneven.py --out DIR`; stopped and run again it goes on. What comes out and what it
means: README.md beside this file.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py

from r2s2r_cli.effects.friction_field import FrictionField

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "13_two_iterations")]
from floors import draw, lay  # noqa: E402 - beside this file
from run import Profile, prepared, r2s2r  # noqa: E402 - of example 13
from world import COMMAND, rig  # noqa: E402

LEARNED, HELD_OUT = "turn-counterclockwise", ("arching", "turn-clockwise")
"""Policies on the uneven floor: what is learned from, and what is predicted."""
REPEATS = 3
QUICK = ("--no-draw", "--no-discrepancy", "--set", "identify.starts=1", "--set", "identify.profiles=0")
"""Of `identify`: the numbers, not how far they can be trusted."""
PLAN = Profile(settings={"plan": {"draws": 8, "candidates": 24, "kept": 4, "beam": 100, "cycles": 3}})


def answered(project: Path, *words: str) -> dict[str, Any]:
    """The report of a command that must succeed."""
    print("$ r2s2r", *words, file=sys.stderr, flush=True)
    done = subprocess.run([*COMMAND, *words, "--json"], cwd=project, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def on_the_even_floor(project: Path) -> None:
    """A random policy twice; speed of the motors and friction (the paper's two), and policies from them."""
    first = project / "iterations" / "001"
    if not (first / "10-record.h5").exists():
        lay(project, "even")
        with rig(project) as robot:
            r2s2r(project, "record", "--iteration", "1", *robot, "--random", "16", "--repeats", "2", "--no-draw")
    if not (first / "40-plan.h5").exists():
        r2s2r(project, "estimate", "--iteration", "1", "--no-draw")
        r2s2r(project, "identify", "--iteration", "1", "--free", "motor_speed", "--free", "friction", *QUICK)
        r2s2r(project, "plan", "--iteration", "1", "--no-draw")


def on_the_uneven_floor(project: Path) -> None:
    """The policies, by the same plan."""
    if not (project / "iterations" / "001" / "50-execute.h5").exists():
        lay(project, "uneven")
        with rig(project) as robot:
            words = [LEARNED, *HELD_OUT, "--repeats", str(REPEATS), "--yes", "--no-draw"]
            r2s2r(project, "execute", *words, "--iteration", "1", *robot)
    if not (project / "iterations" / "001" / "51-estimate.h5").exists():
        r2s2r(project, "estimate", "--of", "execute", "--iteration", "1", "--no-draw")


def known(project: Path) -> dict[str, float]:
    """Speed and friction as the even floor taught them."""
    with h5py.File(project / "iterations" / "001" / "30-identify.h5") as file:
        table = file["parameters"]
        return dict(zip((name.decode() for name in table["name"][:]), table["value"][:].tolist(), strict=True))


def split() -> list[str]:
    """Options: what is learned from, and what is predicted."""
    train = [word for k in range(REPEATS) for word in ("--train", f"{LEARNED}-{k + 1}")]
    return train + [word for name in HELD_OUT for k in range(REPEATS) for word in ("--test", f"{name}-{k + 1}")]


def identified(project: Path, name: str, *words: str) -> Path:
    """What iteration 2 learns with these options, kept under a name of its own."""
    kept = project / f"{name}.h5"
    if not kept.exists():
        r2s2r(project, "identify", "--iteration", "2", *split(), *QUICK, "--force", *words)
        shutil.copy(project / "iterations" / "002" / "30-identify.h5", kept)
    return kept


def explained(project: Path) -> tuple[dict[str, Any], dict[str, Path]]:
    """The diagnosis, and the simulators that are compared."""
    speed, friction = (f"{name}={known(project)[name]:.5g}" for name in ("motor_speed", "friction"))
    even = project / "iterations" / "001" / "30-identify.h5"
    models = {
        "even floor": even,
        "friction refitted": identified(project, "refitted", "--free", "friction", "--fix", speed),
    }
    words = ["--also", "1", "--healthy", "random-0-1", "--healthy", "random-0-2", *split(), "--model", str(even)]
    file = project / "diagnosis.json"
    if not file.exists():
        file.write_text(json.dumps(answered(project, "diagnose", "--iteration", "2", *words, "--force")), "utf-8")
    found: dict[str, Any] = json.loads(file.read_text("utf-8"))["report"]
    sizes = next((one["size"] for one in found["ranking"] if one["effect"] == "friction_field"), {})
    if sizes:
        free = [word for name, value in sizes.items() for word in ("--free", f"{name}={value:.4g}")]
        off = {f"friction_field.{one.name}": one.off for one in FrictionField.own}
        free += [word for name, value in off.items() if name not in sizes for word in ("--fix", f"{name}={value}")]
        field = ("--with-effect", "friction_field", *free, "--fix", speed, "--fix", friction)
        models["with the field"] = identified(project, "field", *field)
    return found, models


def told(project: Path, models: Mapping[str, Path]) -> None:
    """Errors of every simulator, policy by policy, beside the floor."""
    named = [word for name, file in models.items() for word in ("--model", f"{name}={file}")]
    report = answered(project, "compare", "--iteration", "1", "--of", "execute", *named, "--force")["report"]
    print(f"\n{'root mean square over the repeats':34}{'heading [deg]':>16}{'end [mm]':>12}{'key frames [mm]':>18}")
    for policy in (LEARNED, *HELD_OUT):
        mine = [one for one in report["runs"] if one["policy"] == policy]
        print(f"{policy}{', learned from' if policy == LEARNED else ', held out'}")
        for model in dict.fromkeys(one["model"] for one in mine):
            print(f"  {model:32}" + _cells([one for one in mine if one["model"] == model]))
        floor = mine[0]["floor"]
        print(f"  {'floor':32}{math.degrees(floor['heading_end_rad']):16.1f}{1e3 * floor['com_end_m']:12.1f}"
              f"{1e3 * floor['keyframe_cap_m']:18.1f}")  # fmt: skip


def _cells(runs: Sequence[Mapping[str, float]]) -> str:
    def rms(key: str, scale: float) -> float:
        return scale * math.sqrt(sum(one[key] ** 2 for one in runs) / len(runs))

    heading, end, caps = (
        rms("heading_end_error_rad", 57.29578),
        rms("com_end_error_m", 1e3),
        rms("keyframe_cap_rmse_m", 1e3),
    )
    return f"{heading:16.1f}{end:12.1f}{caps:18.1f}"


def main() -> None:
    """Everything, into --out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("uneven-floor"))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    project = prepared(given.out.resolve(), given.seed, PLAN, draw)
    on_the_even_floor(project)
    on_the_uneven_floor(project)
    found, models = explained(project)
    told(project, models)
    print(f"\n{found['sentence']}")
    print(f"true: {json.loads((project / 'drawn.json').read_text('utf-8'))}, a patch as in uneven.toml")
    print(f"look at: {project}/iterations/002/70-diagnose.html and {project}/iterations/001/60-compare.html")


if __name__ == "__main__":
    main()
