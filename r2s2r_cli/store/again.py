"""The command that makes an artifact again, from what it remembers of how it was made."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from schemas.header import Provenance

_PARTS = ("points", "history", "tendons", "masses")


def command_again(made: Provenance, artifact: Path, *, force: bool = False) -> str:
    """The command line, to be pasted in the project's directory; with --force where what lies there looks fresh."""
    flags: dict[str, Any] = made.settings.get("flags", {})
    words = ["r2s2r", made.stage]
    if made.stage == "import":
        words += [ref.path for ref in made.inputs if ref.kind in ("file", "folder")]
        for option in ("format", "depth_scale"):
            if flags.get(option) not in (None, "auto"):
                words += [f"--{option.replace('_', '-')}", str(flags[option])]
    elif made.stage == "calibrate":
        words += [word for part in _PARTS for path in flags.get(part, ()) for word in (f"--{part}", path)]
        words += ["--use", flags["use"]] if "use" in flags else []
    elif made.stage == "simulate":
        words += flags.get("policies", ())
        words += [word for option in ("random", "seed", "from", "model") if flags.get(option) is not None
                  for word in (f"--{option}", str(flags[option]))]  # fmt: skip
        words += [word for run in flags.get("replay", ()) for word in ("--replay", run)]
    elif made.stage == "compare":
        words += [word for name, path in flags.get("models", {}).items() for word in ("--model", f"{name}={path}")]
        words += ["--of", flags.get("of", "record")]
    elif made.stage == "floor":
        words += [word for number in flags.get("iterations", ()) for word in ("--iteration", str(number))]
        words += ["--by", flags["by"]] if flags.get("by", "pose") != "pose" else []
        words += ["--numerics", str(flags["numerics"])] if flags.get("numerics") else []
    elif made.stage == "identify":
        words += _identify(flags)
    if artifact.parent.name.isdigit():
        words += ["--iteration", str(int(artifact.parent.name))]
    return shlex.join([*words, "--force"] if force else words)


def _identify(flags: dict[str, Any]) -> list[str]:
    """Options that differ from their defaults."""
    repeated = (("train", "train"), ("test", "test"), ("free", "free"), ("fix", "fix"), ("with-effect", "effects"),
                ("also", "also"))  # fmt: skip
    words = [word for option, key in repeated for value in flags.get(key, ()) for word in (f"--{option}", str(value))]
    if flags.get("method", "default") != "default":
        words += ["--method", flags["method"]]
    if flags.get("drive") == "closed loop":
        words += ["--drive", "closed-loop"]
    words += ["--online"] if flags.get("online") else []
    return words + (["--seed", str(flags["seed"])] if flags.get("seed") else [])
