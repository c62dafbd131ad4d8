"""How much of what is drawn at random: a share of it in CI, which has 40 minutes for all slow tests, and all of it in
`make test-soak`, which has not."""

from __future__ import annotations

import os


def drawn(few: int, all_of_them: int) -> int:
    """`few` in CI, `all_of_them` in `make test-soak`."""
    return all_of_them if os.environ.get("R2S2R_SOAK") == "1" else few
