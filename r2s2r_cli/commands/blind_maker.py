"""The process that makes blind sets: who runs it is told how far it is, and never what is in them."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Callable, Sequence

from r2s2r_cli.errors import HardwareError, InputError, NumericalError, R2S2RError, UsageError, install_extra

KINDS: dict[int, type[R2S2RError]] = {
    int(kind.exit_code): kind for kind in (UsageError, InputError, HardwareError, NumericalError)
}
"""Of errors, by the exit code of the maker."""


def make_sets(asked: Sequence[str], advance: Callable[[int], None]) -> None:
    """Run the maker with these words and wait for it. advance: told how many sets are new.

    Its errors are ours: UsageError where a package is missing or the words are wrong, and whatever it raises itself;
    KeyboardInterrupt where it was interrupted.
    """
    for module, extra in (("mujoco", "rig"), ("cryptography", "blind")):
        if importlib.util.find_spec(module) is None:
            raise UsageError(f"{module} is not installed", where="r2s2r blind make", expected=f"the extra `{extra}`",
                             received="no such module", hint=install_extra("blind"))  # fmt: skip
    command = [sys.executable, "-m", "r2s2r_cli.blind.make", *asked]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as maker:
        assert maker.stdout is not None and maker.stderr is not None  # noqa: S101 - both are pipes
        done = 0
        facts: dict[str, str] = {}
        try:
            for line in maker.stdout:
                told = json.loads(line)
                if "error" in told:
                    facts = told["error"]
                    continue
                now = int(told["done"])
                advance(now - done)
                done = now
            words = maker.stderr.read().strip()
            code = maker.wait()
        except KeyboardInterrupt:
            maker.terminate()  # a terminal interrupts it too, `kill -INT` this process alone
            raise
    if code == 130:
        raise KeyboardInterrupt
    if code:
        kind = KINDS.get(code, InputError)
        if facts:
            raise kind(**facts)
        raise kind("the maker of blind sets broke off", where="r2s2r blind make", expected="exit code 0",
                   received=words or f"exit code {code}",
                   hint="r2s2r blind make --count 4 --key try.key try")  # fmt: skip
