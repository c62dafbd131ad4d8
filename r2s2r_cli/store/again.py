"""The command that makes an artifact again, from what it remembers of how it was made, or from where it lies."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from r2s2r_cli.store.from_here import project_option
from r2s2r_cli.store.project import ITERATIONS, iteration_number, root_of
from schemas.header import Provenance
from schemas.versions import KINDS, STAGE_VERSIONS

_ROBOT = (("port", "port", None), ("protocol", "protocol", "checked"), ("camera", "camera", None),
          ("repeats", "repeats", 1), ("simulated", "simulated", False))  # fmt: skip
_LINK = ("port", "protocol", "camera", "simulated")
_RUNS = (("train", "train", None), ("test", "test", None), ("also", "also", None), ("seed", "seed", 0))
OPTIONS: dict[str, tuple[tuple[str, str, Any], ...]] = {
    "import": (("format", "format", "auto"), ("depth-scale", "depth_scale", None)),
    "calibrate": (("points", "points", None), ("history", "history", None), ("tendons", "tendons", None),
                  ("masses", "masses", None), ("use", "use", None)),
    "record": (("random", "random", None), ("levels", "levels", 2), ("seed", "seed", 0), ("excite", "excite", None),
               *_ROBOT),
    "estimate": (("of", "of", "record"),),
    "identify": (*_RUNS, ("free", "free", None), ("fix", "fix", None), ("with-effect", "effects", None),
                 ("method", "method", "default"), ("drive", "drive", "command-replay"),
                 ("discrepancy", "discrepancy", True), ("online", "online", False)),
    "plan": (("behaviour", "behaviours", None), ("to", "to", None), ("seed", "seed", 0)),
    "execute": (("model", "model", None), *_ROBOT),
    "simulate": (("random", "random", None), ("seed", "seed", 0), ("replay", "replay", None), ("from", "from", None),
                 ("model", "model", None)),
    "compare": (("model", "models", None), ("of", "of", None), ("own", "own", False)),
    "floor": (("iteration", "iterations", None), ("by", "by", "pose"), ("numerics", "numerics", 0)),
    "diagnose": (*_RUNS, ("healthy", "healthy", None), ("effect", "effects", None), ("model", "model", None)),
}  # fmt: skip
"""Of every stage the options that change its result: name, name among the flags that its provenance has, and the value
that need not be typed. A list is an option for each entry, a table one NAME=VALUE for each."""

SELECTED = {"compare": ("models", "of")}
"""Of every stage the flags that it fills by what is there, unless they are typed."""
GIVEN = "given"
"""Name of a flag: which of those were typed. The others are selected anew; all count as typed where an artifact is from
before this was noted."""

BARE = {"estimate": "estimate", "identification": "identify", "plan": "plan", "comparison": "compare",
        "diagnosis": "diagnose", "floor": "floor"}  # fmt: skip
"""Stages that need no argument, by what they make: theirs is made by their name alone."""


_TOLD_MORE = {"calibration": "calibrate", "simulation": "simulate"}
"""Stages that make one thing each, and that must be told of what."""


def stage_at(path: Path) -> str:
    """The stage that makes what belongs at `path` of a project, told from its name alone, whatever lies there now. Of a
    recording it is `import` where its logs can be guessed, else that of a robot; `-` where no stage makes it (policies
    of another program)."""
    kind = next((spec.kind for spec in KINDS.values() if path.name in spec.filenames), "")
    if kind != "recording":
        return {**BARE, **_TOLD_MORE}.get(kind, "-")
    if path.name == KINDS[kind].executed:
        return "execute"
    return "import" if command_at(path) else "record"


def command_at(path: Path) -> str:
    """The command that makes what belongs at `path` of a project, whatever lies there now; empty where no stage makes
    it without being told more (a calibration, a recording whose logs nobody can guess), and outside a project. To be
    pasted where this runs."""
    path, root = path.absolute(), root_of(path)
    kind = next((spec for spec in KINDS.values() if path.name in spec.filenames and spec.kind in BARE), None)
    if root is None:
        return ""
    if kind is None:
        from r2s2r_cli.store.imported import import_again

        return import_again(path)
    words = ["r2s2r", BARE[kind.kind]]
    if kind.level == "iteration":
        number = iteration_number(path.parent)
        if path.parent.parent != root / ITERATIONS or number is None:
            return ""
        words += [*(["--of", "execute"] * (path.name == kind.executed)), "--iteration", str(number)]
    elif path.parent != root:
        return ""
    return shlex.join([*words, *project_option(root)])


def command_again(made: Provenance, artifact: Path, *, force: bool = False, dry_run: bool = False) -> str:
    """The command line, to be pasted in the project's directory; with --force where what lies there looks fresh.

    dry_run: what a robot did is only shown, with --dry-run and without the robot, which may be gone and must not move
    because a hint was pasted. What no stage made has the command line of the program that did.
    """
    if made.stage not in STAGE_VERSIONS:
        return shlex.join(made.argv)
    flags = _flags(made, artifact)
    words = ["r2s2r", made.stage]
    if made.stage == "import":
        words += [ref.path for ref in made.inputs if ref.kind in ("file", "folder")]
    words += flags.get("policies", ())
    options = [one for one in OPTIONS[made.stage] if not (dry_run and one[0] in _LINK)]
    words += [word for option, key, usual in options for word in _typed(option, flags.get(key), usual)]
    words += [word for key, value in made.overrides.items() for word in ("--set", f"{key}={_toml(value)}")]
    folder = artifact.resolve().parent
    number = iteration_number(folder)
    if folder.parent.name == ITERATIONS and number is not None:
        words += ["--iteration", str(number)]
    return shlex.join([*words, *(["--force"] if force else []), *(["--dry-run"] if dry_run else [])])


def _flags(made: Provenance, artifact: Path) -> dict[str, Any]:
    """What was asked for beside the settings, with what stands elsewhere: the seed of a recording, runs by the name of
    the file, the model of a diagnosis by its inputs."""
    flags: dict[str, Any] = {"seed": made.seed, **made.settings.get("flags", {})}
    if made.stage == "estimate" and artifact.name == KINDS["estimate"].executed:
        flags["of"] = "execute"
    if made.stage == "identify" and "drive" in flags:
        flags["drive"] = flags["drive"].replace(" ", "-")
    if GIVEN in flags:
        selected = {*SELECTED.get(made.stage, ())} - {*flags[GIVEN]}
        flags = {key: value for key, value in flags.items() if key not in selected}
    if made.stage == "diagnose":
        own = f"{ITERATIONS}/{artifact.resolve().parent.name}/{KINDS['identification'].filename}"
        flags["model"] = next((r.path for r in made.inputs if r.kind == "identification" and r.path != own), None)
    return flags


def _typed(option: str, value: Any, usual: Any) -> list[str]:
    """The option as typed; nothing for the usual value, and where the provenance knows nothing of it."""
    if value is None or value == usual:
        return []
    if isinstance(value, bool):
        return [f"--{option}" if value else f"--no-{option}"]
    many = [f"{name}={item}" for name, item in value.items()] if isinstance(value, Mapping) else value
    return [word for one in (many if isinstance(many, list) else [many]) for word in (f"--{option}", str(one))]


def _toml(value: Any) -> str:
    """The value of a setting as `--set` reads it: of numbers, truth values, texts and lists of them JSON is TOML."""
    return json.dumps(value, ensure_ascii=False)
