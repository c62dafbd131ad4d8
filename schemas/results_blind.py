"""What the blind trials say: printed as tables, and put into `--json` documents. SI; shares 0 .. 1."""

from __future__ import annotations

from typing import Literal

from schemas.base import Frozen

Tier = Literal["A", "B"]


class BlindMakeResult(Frozen):
    """A bank that was made, or the part of it that is there."""

    out: str
    key: str
    bank: str
    sets: int
    index_sha256: str
    """To be published before anything is diagnosed."""


class BlindRunResult(Frozen):
    """Verdicts on a bank."""

    bank: str
    out: str
    sets: int
    done: int
    """Sets that have a verdict now."""
    failed: tuple[str, ...]
    """Sets that could not be diagnosed: each is a miss."""
    index_sha256: str
    cpu_median_s: float | None
    """Processor time of a set that was diagnosed now."""


class BlindRow(Frozen):
    """One figure of the table with its target. value None: there is nothing to count."""

    name: str
    what: str
    """In words, with the sets that count."""
    target: float | None
    """None: reported, not asked for."""
    above: bool
    """Whether the target is the least (else the most) that is asked for."""
    unit: Literal["share", "m", "number"]
    value: float | None
    n: int
    low: float | None
    """95 % interval: Wilson's of shares, by bootstrap of others."""
    high: float | None
    passed: bool | None
    """By the point estimate; None: no target, or nothing to count."""
    shown: bool | None
    """Whether all of the interval is on the right side of the target, or all on the wrong."""
    unsaid: int = 0
    """Of the n, those for which no place was said: infinitely far, so that value or bounds may be None."""


class BlindBin(Frozen):
    """Verdicts of about one probability: what they said and how often they were right."""

    low: float
    high: float
    n: int
    said: float
    right: float


class BlindRecall(Frozen):
    """One effect over all its single sets."""

    effect: str
    sets: int
    clear: int
    top1: int
    """Of the clear ones."""
    top3: int
    named: int


class BlindMiss(Frozen):
    """A clear set on which the first guess was wrong."""

    set: str
    truth: str
    d: float
    said: str
    verdict: str
    probability: float | None
    rank: int | None
    """Of the truth among what was ranked, 1-based; None: not there."""
    why: str
    """What is known of it from the label and the verdict."""


class BlindShard(Frozen):
    """One bank of those that were scored together."""

    where: str
    """Its published file, or the folder of its verdicts."""
    index_sha256: str
    sets: int
    scored: int
    commits: tuple[str, ...]
    """Of the code that judged it, as far as it is known."""
    sources_sha256: tuple[str, ...]
    makers_sha256: tuple[str, ...] = ()
    """Of the sources that made its logs and labels; empty: not known."""
    calibrated: tuple[str, ...]
    """Where its probabilities come from."""


class BlindBaseline(Frozen):
    """A diagnoser that looks at nothing, scored on the same labels."""

    name: str
    values: dict[str, float]
    """By the name of the row; rows that it cannot have are left out."""


class BlindCounts(Frozen):
    """How often sets are told: counts, no targets."""

    clear: int
    """Clear single effects; the next four count among them."""
    top1: int
    top3: int
    named: int
    right: int
    """Of the named ones."""
    none: int
    """Sets with nothing wrong."""


class BlindSplit(BlindCounts):
    """The sets with one value of noise, gaits or rate."""

    by: Literal["noise", "gaits", "rate"]
    value: str
    sets: int
    alarms: int
    """Of these, anything but `no_gap`."""
    cpu_median_s: float | None
    """Processor time of a diagnosis."""


class BlindScoreResult(Frozen):
    """Everything `blind score` found."""

    tier: Tier
    bank: str
    sets: int
    scored: int
    failed: int
    index_sha256: str
    strata: dict[str, int]
    rows: tuple[BlindRow, ...]
    classes: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    """[truth][first guess] over sets that are none, clear or out of catalogue and clear, in the order of `classes`."""
    calibration: tuple[BlindBin, ...]
    recall: tuple[BlindRecall, ...]
    misses: tuple[BlindMiss, ...]
    baselines: tuple[BlindBaseline, ...] = ()
    splits: tuple[BlindSplit, ...] = ()
    shards: tuple[BlindShard, ...] = ()
    warnings: tuple[str, ...] = ()


class BlindPublishResult(Frozen):
    """A published file."""

    out: str
    bytes: int
    sets: int
    missing: tuple[str, ...]
    """Sets without a verdict."""
    index_sha256: str
    content_sha256: str
    commits: tuple[str, ...]
    sources_sha256: tuple[str, ...]
    warnings: tuple[str, ...] = ()


class BlindCalibrateResult(Frozen):
    """What a calibration bank taught."""

    out: str
    sets: int
    temperature: float
    """[nats]"""
    commit: float
    conformal: float
    top1: float
    """Share of sets whose first guess is right with numbers learned from the others."""
    log_loss: float
    """Of the truth there [nats]."""
