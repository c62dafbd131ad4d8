"""`identify`: recorded runs in, the numbers of the simulator out, with what they are worth."""

from __future__ import annotations

from r2s2r_cli.stages.identify.identify import identify

__all__ = ["identify"]
