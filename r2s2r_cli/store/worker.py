"""The child process that opens HDF5 files nobody vouches for: `python -m r2s2r_cli.store.worker`.

One JSON request a line on stdin (`{"call": "verify", "path": ...}`), one JSON answer a line on stdout.
"""

from __future__ import annotations

import json
import os
import resource
import sys

READY = "ready"
"""First line of the child: tells a child that cannot start from one that a file has crashed."""
MEMORY_BYTES = 4 << 30
"""Address space of the child: a damaged size field must not take the machine down."""


def main() -> None:
    """Serve requests until stdin closes."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever a C library prints must not mix with the answers
    from r2s2r_cli.store.verify import tree, verify

    calls = {"verify": verify, "tree": tree}
    answers.write(READY + "\n")
    answers.flush()
    for line in sys.stdin:
        request = json.loads(line)
        answer = calls[request["call"]](request["path"])
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
