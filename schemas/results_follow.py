"""What `blind follow` says: printed as a table, and put into its `--json` document."""

from __future__ import annotations

from schemas.base import Frozen


class FollowedSet(Frozen):
    """One ambiguous set, and what was said of it with one more gait. Whether that is right, `blind score` knows."""

    set: str
    gait: str | None
    """The suggested one; None: nothing was suggested, and nothing was run."""
    suggested: str | None
    """The verdict with it: `effect payload`, `no_gap`, `failed`; None: not run yet."""
    random: str | None
    """The same with as many targets by chance."""


class BlindFollowResult(Frozen):
    """Ambiguous sets of a bank, followed up."""

    bank: str
    out: str
    sets: int
    """Of the bank."""
    judged: int
    """Of them with a verdict."""
    ambiguous: int
    done: int
    """Ambiguous sets whose follow-up is written now."""
    without_gait: int
    """Of them those for which nothing was suggested."""
    committed_suggested: int
    """Sets in which the verdict with the suggested gait is not ambiguous any more, rightly or not."""
    committed_random: int
    failed: int
    """Diagnoses that broke off, of both kinds."""
    followed: tuple[FollowedSet, ...]
    index_sha256: str
