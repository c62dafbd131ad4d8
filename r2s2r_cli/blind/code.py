"""Which code judged, or made a bank: commit, and a digest of the sources that a diagnosis, or the maker, can import."""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from r2s2r_cli import __version__
from r2s2r_cli.errors import InputError

BEGIN = ("r2s2r_cli.blind.run", "r2s2r_cli.blind.catalogue")
"""What `blind run` imports of a diagnosis; all else follows."""
LIMIT_S = 30


@cache
def code(root: Path | None = None, begin: tuple[str, ...] = BEGIN) -> dict[str, Any]:
    """Facts of a checkout (`schemas.blind.PublishedCode`). root: its folder; None: where this code lies. begin: modules
    whose imports count. Looked at once a process, which has loaded what it judges with.

    Two commits with the same digest judge alike: what differs between them cannot be reached by a diagnosis. Raises
    InputError where the folder holds no r2s2r.
    """
    home = Path(__file__).resolve().parents[2] if root is None else root.resolve()
    if not (home / "r2s2r_cli" / "__init__.py").exists():
        raise InputError("there is no r2s2r", where=str(home), expected="a checkout with r2s2r_cli/", received="none",
                         hint="r2s2r blind publish --code FOLDER")  # fmt: skip
    commit = _git(home, "rev-parse", "HEAD") if (home / ".git").exists() else None
    changes = _git(home, "status", "--porcelain", "--untracked-files=no", "--", "r2s2r_cli", "schemas")
    whole = sha256()
    for path in sorted(_reached(home, begin)):
        whole.update(f"{path.relative_to(home).as_posix()}\n".encode())
        whole.update(sha256(path.read_bytes()).digest())
    return {"version": __version__, "commit": commit, "changed": bool(commit and changes),
            "sources_sha256": whole.hexdigest()}  # fmt: skip


def _reached(home: Path, begin: tuple[str, ...]) -> set[Path]:
    """Files that these modules import, directly or through others, at the top or inside functions."""
    todo = [path for name in begin for path in _files(home, name)]
    found: set[Path] = set()
    while todo:
        path = todo.pop()
        if path not in found:
            found.add(path)
            todo += [one for name in _imports(path) for one in _files(home, name)]
    return found


_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")
"""Where statements hold statements."""


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """The module and all its statements, those within others too. Expressions are not gone through, which are most."""
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        yield node
        for block in _BLOCKS:
            todo += getattr(node, block, ())


def _imports(path: Path) -> Iterator[str]:
    for node in statements(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{one.name}" for one in node.names)


def _files(home: Path, name: str) -> Iterator[Path]:
    """Of a module of ours, with those of the packages that hold it; none for others, or for a name inside a module."""
    parts = name.split(".")
    if parts[0] not in ("r2s2r_cli", "schemas"):
        return
    for n in range(1, len(parts) + 1):
        place = home.joinpath(*parts[:n])
        for path in (place / "__init__.py", place.with_suffix(".py")):
            if path.is_file():
                yield path


def _git(home: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(home), *arguments], capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
