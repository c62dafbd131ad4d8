"""The command that looks at the robot on a port, for hints: it can be pasted, and speaks the robot's protocol."""

from __future__ import annotations

import shlex


def look_at(port: str, protocol: str = "", *, reset: bool = False) -> str:
    """`r2s2r doctor ports PORT`. protocol: "" where it is not known. reset: its emergency stop is taken off first."""
    more = (["--reset"] if reset else []) + (["--protocol", protocol] if protocol else [])
    return shlex.join(["r2s2r", "doctor", "ports", port, *more])
