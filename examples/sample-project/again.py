"""Run every stage of a project again and compare with what is stored: `python again.py PROJECT` (minutes).

`--newest` makes of every stage only the last artifact again, not that of every iteration.

For a lab's own CI as well: it needs nothing but r2s2r and the project's directory, of which it works on a copy. The
robot is not moved: `record` (where the project has a virtual robot to look at: world.toml) and `execute` are run with
--dry-run. Every stage gets the *stored* artifacts before it as its input, so
that differences do not add up. Exit code 1 where a result is not what it was; how much may differ, and why, stands in
RULES.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.util import find_spec
from itertools import takewhile
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs
from r2s2r_cli.store.again import command_again
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from schemas.header import Provenance

LENGTHS = 0.02
"""Part by which the number of frames of a simulated run may differ: a target may be reached a tick later."""


@dataclass(frozen=True)
class Rule:
    """How much the values of a dataset may differ, root mean square. what: GROUP/DATASET, or GROUP@ATTRIBUTE, with
    wildcards. relative: to the root mean square of what is stored."""

    kind: str
    what: str
    limit: float
    relative: bool = False


RULES = (
    # Lines through points: rounding only.
    Rule("calibration", "*", 1e-6, relative=True),
    # The tracker is the same arithmetic on the same pictures; other packages decode and round otherwise. Its own
    # standard deviation is about 1 mm.
    Rule("estimate", "runs/*/frames/t", 1e-9),
    Rule("estimate", "runs/*/frames/p_WE", 0.5e-3),
    Rule("estimate", "runs/*/frames/length", 0.5e-3),
    # A fit stops where the next step gains nothing: within its standard deviations, which are a few per cent.
    Rule("identification", "parameters/value", 0.05, relative=True),
    # Contact lets rounding grow: of gaits that are as good as each other another may be found.
    Rule("plan", "symmetry/*", 1e-6),
    Rule("plan", "primitives/score", 0.15, relative=True),
    Rule("plan", "long/mean", 0.15, relative=True),
    Rule("simulation", "runs/*/frames/p_WE", 10e-3),
    Rule("simulation", "runs/*/frames/length", 5e-3),
    Rule("floor", "caps@floor", 0.05, relative=True),
    # The key-frame error of the refit, on one interval; which effect comes first is not decided by so few runs.
    Rule("diagnosis", "judged/nominal", 5e-3),
    Rule("diagnosis", "judged/refit", 10e-3),
    Rule("comparison", "runs/*/real/*", 1e-6),
    Rule("comparison", "runs/*/simulated/trained_on", 0.0),
    Rule("comparison", "runs/*/simulated/keyframe", 2e-3),
    Rule("comparison", "runs/*/simulated/com_end_error", 10e-3),
    Rule("comparison", "runs/*/simulated/heading_end_error", 0.1),
    Rule("comparison", "runs/*/simulated/duration", 0.1),
)
"""What is compared. Everything else must be there, in its type and with its dimensions."""


def main(root: Path, say: Callable[[str], None] = print, *, newest: bool = False) -> list[str]:
    """Every stage of the project again, in a copy. newest: of each stage the last artifact only. Returns what is not as
    it was, in words."""
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / root.resolve().name
        shutil.copytree(root, copy)
        project = Project.find(copy)
        wrong += [_must(["validate"], copy, say), _must(["status"], copy, say)]
        for path in _newest(project) if newest else project.artifacts():
            wrong += _again(project, path, say)
    return [text for text in wrong if text]


def differences(old: ArtifactData, new: ArtifactData, rules: Sequence[Rule] = RULES) -> Iterator[str]:
    """What is not as it was, in words, dataset by dataset."""
    one, two = dict(_values(old)), dict(_values(new))
    for name in sorted(one.keys() ^ two.keys()):
        yield f"{name} is {'gone' if name in one else 'new'}"
    mine = [rule for rule in rules if rule.kind == old.kind]
    for name in sorted(one.keys() & two.keys()):
        rule = next((rule for rule in mine if fnmatch(name, rule.what)), None)
        if (text := _difference(one[name], two[name], rule)) is not None:
            yield f"{name}: {text}"


def _newest(project: Project) -> list[Path]:
    """Of every stage the last artifact that a command makes again, in the order in which they were made; and the last
    recording, whose command is tried."""
    last: dict[str, Path] = {}
    for path in project.artifacts():
        made = read_header(path).provenance
        if made.stage == "record" or _why_not(project, made) is None:
            last[made.stage] = path
    return [path for path in project.artifacts() if path in last.values()]


def _why_not(project: Project, made: Provenance) -> str | None:
    """Why no command makes an artifact again, or None where one does."""
    if made.stage in ("record", "execute"):
        return "it was measured"  # the plan asks what would be executed
    if made.stage == "collect":
        return "it was collected by hand"
    if made.stage == "import" and not all((project.root / ref.path).exists() for ref in made.inputs):
        return "the files it was made from are not kept"
    if made.stage == "estimate" and not _has_sightings(project, made.inputs[0].path):
        return "the pictures it was made from are not kept"
    return None


def _again(project: Project, path: Path, say: Callable[[str], None]) -> Iterator[str]:
    """One artifact: its stage, the comparison; then what was stored is put back."""
    name, kept = project.relative(path), path.read_bytes()
    made = read_header(path).provenance
    number = path.parent.name
    if made.stage == "record":
        yield _would_record(project.root, shlex.split(command_again(made, path, force=True))[1:], say)
    if (why := _why_not(project, made)) is not None:
        say(f"{name}: {why}")
        return
    header, old = read_artifact(path)
    words = [*shlex.split(command_again(made, path, force=True))[1:], "--no-draw"]
    failed = _must(words, project.root, say)
    if failed:
        yield failed
    else:
        new = read_header(path)
        found = [] if new.content_sha256 == header.content_sha256 else list(differences(old, read_artifact(path)[1]))
        same = new.content_sha256 == header.content_sha256
        say(f"{name}: {'the same, bit by bit' if same else 'within tolerance' if not found else 'NOT as it was'}")
        yield from (f"{name}: {text}" for text in found)
    if made.stage == "plan" and (path.parent / "50-execute.h5").exists():
        yield _must(["execute", "--iteration", number, "--dry-run", "--force"], project.root, say)
    path.write_bytes(kept)


def _would_record(root: Path, words: Sequence[str], say: Callable[[str], None]) -> str:
    """The plan of a recording, and what the sensors of the virtual robot say, at the ports that it has this time."""
    if not (root / "world.toml").exists() or find_spec("mujoco") is None:
        say("record: no virtual robot to look at (world.toml and the extra rig make one)")
        return ""
    try:
        with virtual_robot(root) as given:
            known = [given.get(before, word) for before, word in zip(["", *words], words, strict=False)]
            return _must([*known, "--dry-run"], root, say)
    except SystemExit as error:
        return str(error)


@contextmanager
def virtual_robot(root: Path) -> Iterator[dict[str, str]]:
    """The rig of a project in lock-step, in the world of its world.toml; the options that name it."""
    command = [sys.executable, "-m", "r2s2r_cli", "rig", "--fast", "--link", "tcp", "--world", "world.toml",
               "--camera-port", "0", "--json"]  # fmt: skip
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) as process:
        try:
            printed = [*takewhile(lambda line: line.rstrip() != "}", process.stdout or ()), "}"]
            where = json.loads("".join(printed)) if len(printed) > 1 else {}
            if "device" not in where:  # nothing, or what is wrong
                raise SystemExit("the rig did not start")
            yield {"--port": where["device"], "--camera": where["camera"]}
        finally:
            process.terminate()


def _has_sightings(project: Project, recording: str) -> bool:
    """Whether states can be estimated from a recording: it holds pictures, or end caps."""
    return any(
        re.search(r"/(camera/depth/bytes|caps/p_WE)", name) for name in read_header(project.root / recording).datasets
    )


def _must(words: Sequence[str], root: Path, say: Callable[[str], None]) -> str:
    """A command that must succeed; else what it said."""
    say("$ r2s2r " + shlex.join(words))
    command = [sys.executable, "-m", "r2s2r_cli", *words]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return (
        ""
        if done.returncode == 0
        else f"r2s2r {shlex.join(words)}: exit code {done.returncode}: {done.stderr.strip()[-600:]}"
    )


def _values(data: ArtifactData) -> Iterator[tuple[str, np.ndarray]]:
    for path, group in data.groups.items():
        yield from ((f"{path}/{name}", value) for name, value in group.datasets.items() if not isinstance(value, Blobs))
        for name, fact in group.attributes.items():
            if isinstance(fact, float | int):
                yield f"{path}@{name}", np.asarray(fact)


def _difference(old: np.ndarray, new: np.ndarray, rule: Rule | None) -> str | None:
    if old.dtype.kind != new.dtype.kind or old.ndim != new.ndim:
        return f"was {old.dtype} {old.shape}, is {new.dtype} {new.shape}"
    if old.shape != new.shape:
        if (
            rule is None
            or old.ndim == 0
            or old.shape[1:] != new.shape[1:]
            or abs(len(old) - len(new)) > LENGTHS * len(old)
        ):
            return None if rule is None else f"was {old.shape}, is {new.shape}"
        old, new = old[: len(new)], new[: len(old)]
    if rule is None:
        return None
    if old.dtype.kind not in "biuf":
        return None if np.array_equal(old, new) else "other words"
    a, b = old.astype(float), new.astype(float)
    if (np.isnan(a) != np.isnan(b)).any():
        return "other values are missing"
    size = float(np.sqrt(np.nanmean(a**2))) if rule.relative and a.size else 1.0
    away = float(np.sqrt(np.nanmean((a - b) ** 2))) if a.size and np.isfinite(a).any() else 0.0
    return None if away <= rule.limit * size else f"differs by {away:.3g}, allowed {rule.limit * size:.3g}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.epilog = "It works on a copy. Exit code 1 where a result is not what it was."
    where = "the project's directory; without it, the sample project"
    parser.add_argument("project", type=Path, nargs="?", default=Path(__file__).parent / "project", help=where)
    parser.add_argument("--newest", action="store_true", help="of every stage the last artifact only")
    asked = parser.parse_args()
    found = main(asked.project, newest=asked.newest)
    print("\n".join(found) if found else "every stage gave again what is stored")
    sys.exit(1 if found else 0)
