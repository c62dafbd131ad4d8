"""A recording in which nothing was seen: only the command that made it can say what to type instead."""

from __future__ import annotations

from r2s2r_cli.errors import InputError


class Unseen(InputError):
    """There are no pictures and no end caps, or not all that the tracker needs."""
