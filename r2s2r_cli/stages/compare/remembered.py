"""What a simulated run is known by again: a comparison that was interrupted does not simulate it a second time."""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from r2s2r_cli.stages.compare.runs import RealRun
from r2s2r_cli.stages.identified import Identified
from schemas.config import SimulateSettings


def question(numbers: Identified, run: RealRun, settings: SimulateSettings) -> bytes:
    """Digest of all that a simulation of this run depends on: robot, laws, effects and numbers of the simulator, what
    was given to the real robot and seen of it, and how it is simulated."""
    mapping = numbers.mapping
    effects = tuple(effect.name for effect in numbers.structure.effects)
    found = hashlib.sha256()
    for part in (
        numbers.robot.model_dump_json(), mapping.names, sorted(mapping.fixed.items()), effects, numbers.values,
        numbers.bias, numbers.command_delay, settings.model_dump_json(), run,
    ):  # fmt: skip
        _add(found, part)
    return found.digest()


def _add(found: Any, part: Any) -> None:
    """An array with its type and shape, a dataclass field by field, anything else as it prints."""
    if is_dataclass(part):
        for field in fields(part):
            _add(found, field.name)
            _add(found, getattr(part, field.name))
    elif isinstance(part, np.ndarray):
        found.update(repr((part.dtype.str, part.shape)).encode() + np.ascontiguousarray(part).tobytes())
    else:
        found.update(repr(part).encode() + b"\n")
