"""What a compiled step depends on, as one hash: the name of its machine code on disk."""

from __future__ import annotations

import hashlib
import inspect
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from uuid import uuid4

import torch

from r2s2r_cli.engine.hooks import Hooks
from r2s2r_cli.engine.structure import Structure


def trace_key(structure: Structure) -> str:
    """What a compiled step depends on: the structure, the engine's sources, and those of its effects."""
    plain = replace(structure, effects=())
    digest = hashlib.sha256(repr(plain).encode())
    digest.update(_SOURCES)
    for effect in structure.effects:
        digest.update(repr(effect).encode())
        try:
            # The law may lie in a base class: every class between the effect and Hooks counts.
            for law in type(effect).__mro__[: type(effect).__mro__.index(Hooks)]:
                digest.update(Path(inspect.getfile(law)).read_bytes())
            known = type(effect).__repr__ is not object.__repr__
        except (OSError, TypeError):
            known = False
        if not known:
            # Typed at a prompt, or without a `__repr__` that says what it holds: nobody can tell whether it is the same
            # law next time, so nothing is found on disk again.
            digest.update(uuid4().bytes)
    return digest.hexdigest()


def _sources() -> bytes:
    digest = hashlib.sha256(f"{torch.__version__} {version('roma')}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.digest()


_SOURCES = _sources()
"""Read when the engine is imported: sources edited afterwards are not what this process traces."""
