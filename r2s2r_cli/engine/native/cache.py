"""Object code on disk: one file a kernel, named by everything that it depends on.

A file that is damaged, foreign or unreadable counts as absent; a directory that cannot be written costs speed only.
"""

from __future__ import annotations

import json
import os
import tempfile
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from r2s2r_cli.engine.native import machine

_MAGIC = b"r2s2r kernel 2\n"


@lru_cache(maxsize=1)
def source_hash() -> str:
    """Hash of this package's own source, of the compiler and of the processor."""
    digest = sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    import llvmlite
    import torch

    for word in (llvmlite.__version__, torch.__version__, *machine.host()):
        digest.update(word.encode())
    return digest.hexdigest()


def file_name(*parts: Any) -> str:
    """Name of the file of the kernel that these values (JSON types) describe."""
    return sha256(json.dumps([source_hash(), *parts]).encode()).hexdigest() + ".kernel"


def read(path: Path) -> tuple[dict[str, Any], bytes] | None:
    """What is known about the kernel, and its object code; None if there is no whole file."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    head, _, rest = content[len(_MAGIC) :].partition(b"\n")
    if not content.startswith(_MAGIC) or head != sha256(rest).hexdigest().encode():
        return None
    line, _, code = rest.partition(b"\n")
    return json.loads(line), code


def write(path: Path, about: dict[str, Any], code: bytes) -> None:
    """Write a kernel: whole under its name, or not at all."""
    rest = json.dumps(about).encode() + b"\n" + code
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".kernel-")
        with os.fdopen(handle, "wb") as file:
            file.write(_MAGIC + sha256(rest).hexdigest().encode() + b"\n" + rest)
        Path(temporary).replace(path)
    except OSError:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
