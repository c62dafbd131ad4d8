"""The child process that opens HDF5 files nobody vouches for: `python -m r2s2r_cli.store.worker`.

One JSON request a line on stdin (`{"call": "verify", "path": ...}`), one JSON answer a line on stdout.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
from collections.abc import Callable
from typing import Any

READY = "ready"
"""First line of the child: tells a child that cannot start from one that a file has crashed."""
MEMORY_BYTES = 4 << 30
"""Address space of the child: a damaged size field must not take the machine down."""


def main() -> None:
    """Serve requests until stdin closes."""
    for limit, size in ((resource.RLIMIT_AS, MEMORY_BYTES), (resource.RLIMIT_CORE, 0)):
        with contextlib.suppress(OSError, ValueError):  # a lower limit is set already
            resource.setrlimit(limit, (size, size))
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="replace")
    os.dup2(2, 1)  # whatever a C library prints must not mix with the answers
    from r2s2r_cli.store.salvage import facts, save
    from r2s2r_cli.store.verify import tree, verify

    calls: dict[str, Callable[..., dict[str, Any]]] = {"verify": verify, "tree": tree, "facts": facts, "save": save}
    answers.write(READY + "\n")
    answers.flush()
    for line in sys.stdin:
        request = json.loads(line)
        answer = calls[request.pop("call")](**request)
        answers.write(json.dumps(answer, ensure_ascii=False) + "\n")  # names that are no text come out as "?"
        answers.flush()


if __name__ == "__main__":
    main()
