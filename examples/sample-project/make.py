"""Make the sample project anew: `python examples/sample-project/make.py --out DIR` (minutes).

Two iterations of the loop on the virtual robot, through the same commands, protocol, camera and tracker as on a real
one; nothing that the rig knows to be true enters. Its floor has half the friction and its motors 75 % of the speed that
robot.toml says. Pictures from the camera are kept of the first, short run only (small ones): of the executed runs what
was estimated from them stays, and the hash of the recording with its pictures. What is in it and how it is checked:
README.md.
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from again import virtual_robot

FIRST = ("straight", "turn-counterclockwise")
SECOND = ("arching", "turn-clockwise")
REPEATS = 2
SETTINGS = {
    "identify.free": ["friction", "motor_speed"], "identify.starts": 1, "identify.profiles": 0,
    "identify.max_iterations": 3, "identify.train_share": 1.0, "identify.step_s": 0.002, "simulate.step_s": 0.002,
    "plan.step_s": 0.002, "plan.depth": 3, "plan.beam": 40, "plan.draws": 3, "plan.starts": 2, "plan.candidates": 9,
    "plan.kept": 2, "plan.cycles": 2, "record.rest_s": 1.0, "record.jpeg_quality": 80, "record.camera_hold_s": 0.5,
}  # fmt: skip
"""What differs from the defaults: a small problem, so that all stages together take minutes to repeat."""
WORLD = """\
# The virtual robot of this project. Read by `r2s2r rig` alone.
seed = 12
[floor]
friction = 0.35
[start]
put_back = true
[effects.motor_speed_mismatch]
factors = [0.75, 0.75, 0.75, 0.75, 0.75, 0.75]
"""
LARGE = """\
[camera]
position_m = [0.0, 0.0, 2.0]
[camera.clock]
rate_hz = 10.0
"""
SMALL = """\
[camera]
position_m = [0.0, 0.0, 1.2]
width = 320
height = 240
fx = 303.85
fy = 303.85
cx = 160.0
cy = 120.0
[camera.clock]
rate_hz = 5.0
"""
WALK = """\
schema_version = 1
robot = "threebar"
name = "walk"
description = "two shapes and back, twice: what repeats in it is the floor"
repeat = 2
[[steps]]
target = [0.5, 1.0, 1.0, 1.0, 0.4, 1.0]
[[steps]]
target = [1.0, 0.4, 1.0, 0.5, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""
PICTURES = ("color", "depth")


@dataclass(frozen=True)
class Bench:
    """The project that is made."""

    root: Path

    def r2s2r(self, *words: str) -> None:
        """A command that must succeed; its provenance names no folder of this machine."""
        print("$ r2s2r " + " ".join(words), flush=True)
        code = "import sys; sys.argv[0] = 'r2s2r'; from r2s2r_cli.__main__ import main; main()"
        subprocess.run([sys.executable, "-c", code, *words], cwd=self.root, check=True)

    @contextmanager
    def rig(self, camera: str) -> Iterator[tuple[str, ...]]:
        """The virtual robot in lock-step with this camera; options that name it."""
        (self.root / "world.toml").write_text(WORLD + camera)
        with virtual_robot(self.root) as options:
            yield tuple(chain.from_iterable(options.items()))

    def execute(self, iteration: int, policies: tuple[str, ...]) -> None:
        """Executed, estimated, without its pictures."""
        here = ("--iteration", str(iteration))
        with self.rig(LARGE) as robot:
            self.r2s2r("execute", *policies, "--repeats", str(REPEATS), "--yes", "--no-draw", *here, *robot)
        self.r2s2r("estimate", "--of", "execute", "--no-draw", *here)
        without_pictures(self.root / "iterations" / f"{iteration:03d}" / "50-execute.h5")


def main(out: Path) -> None:
    """All of it, into a folder that this replaces."""
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    Bench(out.parent.resolve()).r2s2r("init", out.name, "--robot", "threebar", "--quiet")
    bench = Bench(out.resolve())
    settle(bench.root / "project.toml")
    (bench.root / "world.toml").write_text(WORLD + SMALL)
    (bench.root / "policies").mkdir()
    (bench.root / "policies" / "walk.toml").write_text(WALK)
    bench.r2s2r("rig", "--world", "world.toml", "--points", "points.csv")
    bench.r2s2r("calibrate", "--points", "points.csv", "--no-draw")
    with bench.rig(SMALL) as robot:
        bench.r2s2r("record", "policies/walk.toml", "--no-draw", *robot)
    for words in (("estimate",), ("identify",), ("plan",)):
        bench.r2s2r(*words, "--no-draw")
    bench.execute(1, FIRST)
    bench.r2s2r(
        "simulate", "iterations/001/40-plan.h5:straight", "--model", "iterations/001/30-identify.h5", "--no-draw"
    )
    (bench.root / "iterations" / "002").mkdir()
    for words in (("identify",), ("plan",)):
        bench.r2s2r(*words, "--iteration", "2", "--no-draw")
    bench.execute(2, SECOND)
    for words in (("floor",), ("compare", "--iteration", "1"), ("compare", "--iteration", "2"),
                  ("diagnose", "--iteration", "1")):  # fmt: skip
        bench.r2s2r(*words, "--no-draw")
    collect(bench.root)
    for name in (".r2s2r", "world.toml.lock"):
        shutil.rmtree(bench.root / name, ignore_errors=True)
    bench.r2s2r("status")
    size = sum(path.stat().st_size for path in bench.root.rglob("*") if path.is_file())
    print(f"{size / 1e6:.1f} MB in {bench.root}")


def update(out: Path) -> None:
    """Make again what is stale, in its order: after a change of a stage, without the robot. What was executed stays,
    and so do the states whose pictures are not kept."""
    from r2s2r_cli.store.again import command_again
    from r2s2r_cli.store.header import read_header
    from r2s2r_cli.store.project import Project

    bench = Bench(out.resolve())
    later = ("floor", "compare", "diagnose")  # in this order, after everything that they read
    found = [(read_header(path).provenance, path) for path in Project.find(bench.root).artifacts()]
    for made, path in sorted(found, key=lambda one: 1 + later.index(one[0].stage) if one[0].stage in later else 0):
        if made.stage in ("record", "execute", "collect") or path.name.startswith("51-"):
            continue
        bench.r2s2r(*shlex.split(command_again(made, path))[1:], "--no-draw")
    collect(bench.root)
    shutil.rmtree(bench.root / ".r2s2r", ignore_errors=True)


def collect(root: Path) -> None:
    """The policies of the project in one artifact, `policies.h5`: the recorded one and the executed ones.

    No command writes this kind; every command that takes a policy reads it (`r2s2r simulate policies.h5:walk`)."""
    from datetime import UTC, datetime

    from r2s2r_cli.artifact import ArtifactData
    from r2s2r_cli.commands.simulate_inputs import read_policies
    from r2s2r_cli.stages.simulate.policies import policy_group
    from r2s2r_cli.store.header import whole_header
    from r2s2r_cli.store.project import Project
    from r2s2r_cli.store.provenance import build_provenance
    from r2s2r_cli.store.staleness import artifact_ref, source_ref
    from r2s2r_cli.store.write import write_artifact

    project = Project.find(root)
    walk = root / "policies" / "walk.toml"
    plans = {root / "iterations" / f"{number:03d}" / "40-plan.h5": names for number, names in ((1, FIRST), (2, SECOND))}
    texts = [str(walk), *(f"{plan}:{name}" for plan, names in plans.items() for name in names)]
    groups = {f"policies/{one.name}": policy_group(one) for text in texts for one in read_policies(text)}
    inputs = [source_ref(project, walk), *(artifact_ref(project, plan, whole_header(plan)) for plan in plans)]
    made = build_provenance(
        stage="collect", stage_version=1, argv=["make.py"], settings={"flags": {}}, overrides={}, robot={},
        inputs=inputs, started=datetime.now(UTC), wall_s=0.0,
    )  # fmt: skip
    write_artifact(project.artifact("policy", None), ArtifactData("policy", groups), made)


def settle(path: Path) -> None:
    """Write the settings into project.toml, its comments kept."""
    import tomlkit

    document = tomlkit.parse(path.read_text("utf-8"))
    for name, value in SETTINGS.items():
        section, key = name.split(".")
        document[section][key] = value
    path.write_text(tomlkit.dumps(document), "utf-8")


def without_pictures(path: Path) -> None:
    """Take the camera's pictures out of a recording; times and numbers of the frames stay.

    The content hash that it had is kept as that of a former form, so that what was made of it stays fresh.
    """
    from r2s2r_cli.artifact import ArtifactData, Group
    from r2s2r_cli.store.read import read_artifact
    from r2s2r_cli.store.write import write_artifact
    from schemas.header import MigrationNote

    header, data = read_artifact(path, "recording")
    groups = {}
    for name, group in data.groups.items():
        if name.endswith("/camera"):
            group = Group({k: v for k, v in group.datasets.items() if k not in PICTURES}, dict(group.attributes))
        groups[name] = group
    note = MigrationNote(
        from_version=header.schema_version, to_version=header.schema_version, content_sha256=header.content_sha256
    )
    made = header.provenance.model_copy(update={"migrations": (*header.provenance.migrations, note)})
    write_artifact(path, ArtifactData(data.kind, groups), made)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "project", help="folder that is replaced")
    parser.add_argument("--update", action="store_true", help="only what is stale, without the robot")
    asked = parser.parse_args()
    (update if asked.update else main)(asked.out)
