"""What a compiled step depends on, as one hash: the name of its machine code on disk."""

from __future__ import annotations

import hashlib
import inspect
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
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
                for path in _files_of(law):
                    digest.update(path.read_bytes())
            known = type(effect).__repr__ is not object.__repr__
        except (OSError, TypeError):
            known = False
        if not known:
            # Typed at a prompt, or without a `__repr__` that says what it holds: nobody can tell whether it is the same
            # law next time, so nothing is found on disk again.
            digest.update(uuid4().bytes)
    return digest.hexdigest()


def _files_of(law: type) -> list[Path]:
    """The file of a class, and those of the modules of its package, or of its folder, that it takes anything from: a
    law may keep its formulas in one of them. Raises OSError, TypeError as `inspect.getfile`."""
    own = Path(inspect.getfile(law))
    package = law.__module__.rpartition(".")[0]
    found: dict[str, Path] = {}
    waiting = [law.__module__]
    while waiting:
        name = waiting.pop()
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None)
        if module is None or file is None or name in found:
            continue
        if not (package and name.startswith(f"{package}.")) and Path(file).parent != own.parent:
            continue
        found[name] = Path(file)
        for value in list(vars(module).values()):
            of = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            waiting += [of] if isinstance(of, str) else []
    return [own, *(found[name] for name in sorted(found) if found[name] != own)]


def _sources() -> bytes:
    digest = hashlib.sha256(f"{torch.__version__} {version('roma')}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.digest()


_SOURCES = _sources()
"""Read when the engine is imported: sources edited afterwards are not what this process traces."""
