"""How much of what is drawn at random, or takes minutes a case: a share of it in CI, which has 40 minutes for all slow
tests, and all of it in `make test-soak`, which has not."""

from __future__ import annotations

import os
from typing import TypeVar

T = TypeVar("T")


def drawn(few: T, all_of_them: T) -> T:
    """`few` in CI, `all_of_them` in `make test-soak`."""
    return all_of_them if os.environ.get("R2S2R_SOAK") == "1" else few
