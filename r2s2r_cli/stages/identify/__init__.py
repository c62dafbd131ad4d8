"""`identify`: recorded runs in, the numbers of the simulator out, with what they are worth."""

from __future__ import annotations




