"""What a compiled step depends on, as one hash: the name of its machine code on disk."""

from __future__ import annotations

import ast
import hashlib
import inspect
from dataclasses import replace
from functools import lru_cache
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
                for source in _sources_of(law):
                    digest.update(source)
            known = type(effect).__repr__ is not object.__repr__
        except (OSError, TypeError, SyntaxError, ValueError):
            known = False
        if not known:
            # Typed at a prompt, or without a `__repr__` that says what it holds: nobody can tell whether it is the same
            # law next time, so nothing is found on disk again.
            digest.update(uuid4().bytes)
    return digest.hexdigest()


def _sources_of(law: type) -> list[bytes]:
    """The file of a class, and those beside it or of its package that it imports, wherever it does, and so on: a law
    may keep its formulas and constants in one of them. Raises OSError, TypeError as `inspect.getfile`, SyntaxError and
    ValueError where one of them is no Python."""
    own = Path(inspect.getfile(law))
    parts = law.__module__.split(".")[: None if own.stem == "__init__" else -1]
    if own.suffix != ".py" or len(own.parents) <= len(parts):
        return [own.read_bytes()]
    root = own.parents[len(parts)]
    # Our own effects need no more than their folder: the engine's sources count anyway.
    within = root / parts[0] if parts and parts[0] != __name__.partition(".")[0] else own.parent
    found = {own: own.read_bytes()}
    waiting = [own]
    while waiting:
        file = waiting.pop()
        for name in _imports(found[file], file.relative_to(root).parent.parts):
            stem = root.joinpath(*name)
            for path in (stem.with_suffix(".py"), stem / "__init__.py"):
                if path not in found and path.is_relative_to(within) and path.is_file():
                    found[path] = path.read_bytes()
                    waiting.append(path)
    return [found[path] for path in sorted(found)]


@lru_cache(maxsize=256)  # the base of all effects would be parsed for every one of them
def _imports(source: bytes, package: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Names that a source of a package imports, in their parts; what is taken from a module may be one itself."""
    names: list[tuple[str, ...]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [tuple(one.name.split(".")) for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = (*above, *(node.module.split(".") if node.module else ()))
            names += [base, *((*base, one.name) for one in node.names)]
    return tuple(names)


def _sources() -> bytes:
    digest = hashlib.sha256(f"{torch.__version__} {version('roma')}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.digest()


_SOURCES = _sources()
"""Read when the engine is imported: sources edited afterwards are not what this process traces."""
