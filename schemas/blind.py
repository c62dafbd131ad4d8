"""The published file of a blind bank: its list, its opened labels, and of every verdict what scoring and calibration
need.

A reader without the key can check it: the SHA-256 of `index` is the one that was published before anything was
diagnosed, and that of `{"label": label, "salt": salt}` (JSON, keys sorted, separators `, ` and `: `) stands in `index`.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.results_diagnose import ElementFound, PairFound, Verdict

Format = Literal["r2s2r blind published 1"]


class PublishedCode(Frozen):
    """What judged. commit None: not from a checkout."""

    version: str
    commit: str | None
    changed: bool
    """The checkout had changes that were not committed."""
    sources_sha256: str
    """Of the source files that a diagnosis can import, without the learned calibration."""


class PublishedAsked(Frozen):
    """What makes a run of verdicts another one."""

    diagnoser: str
    settings: dict[str, Any]
    """Other than the default; without folders and numbers of threads."""
    shuffled: int | None


class PublishedRank(Frozen):
    """One name of the ranking."""

    effect: str
    elpd_gain: float
    elpd_gain_sd: float | None = None
    linear_gain: float | None = None
    """Of shards judged before version 7 of `diagnose`; not used."""
    marginal_nats: float | None = None
    """Since version 13 of `diagnose`."""
    parity_nats: float = 0.0
    fitted: bool = True
    seen_sd: float | None = None
    """Since version 14 of `diagnose`."""
    strain_nats: float | None = None
    """Since version 20 of `diagnose`."""
    probability: float
    size: dict[str, float] = Field(default_factory=dict)
    channel: str | None = None
    element: ElementFound | None = None
    rmse_m: float | None = None
    moved: bool = True


class PublishedWhere(Frozen):
    """Where the gap lies."""

    channel: str | None = None
    element: ElementFound | None = None
    onset_segment: int | None = None


class PublishedShrinkage(Frozen):
    """How far the gap shrinks on judged intervals; errors [m]."""

    effects: tuple[str, ...] = ()
    nominal: float | None = None
    refit: float | None = None
    refit_plus_effect: float | None = None
    ceiling: float | None = None
    floor: float | None = None
    own_share: float | None = None
    ci90: tuple[float, float] | None = None
    predicted: float | None = None


class PublishedNext(Frozen):
    """The gait that was suggested."""

    name: str
    nats: float
    now: float | None = None
    narrows: int | None = None


class PublishedDiagnosis(Frozen):
    """The part of a diagnosis that is scored, that calibrates, and that explains a miss."""

    verdict: Verdict
    sentence: str = ""
    effects: tuple[str, ...]
    probability: float
    set90: tuple[str, ...]
    ranking: tuple[PublishedRank, ...]
    pairs: tuple[PairFound, ...] = ()
    where: PublishedWhere | None = None
    shrinkage: PublishedShrinkage | None = None
    next_gait: PublishedNext | None = None
    not_testable: tuple[str, ...] = ()
    confusable: tuple[tuple[str, str, float], ...] = ()
    parity: tuple[str, ...] = ()
    chance_nats: float
    gap_nats: float | None = None
    left_nats: float | None = None
    left_sd_nats: float | None = None
    stranger_sd2: float | None = None
    refit_rmse_m: float | None = None
    refit_upper_m: float | None = None
    refit_floor_m: float | None = None
    refit_kept: float = 1.0
    floor_m: float
    calibrated: str = ""


class PublishedVerdict(Frozen):
    """What was said of one set."""

    sha256: str
    """Of the verdict file of `blind run`."""
    logs: str
    """Digest of the logs that were diagnosed."""
    opened: int
    """Files that were opened meanwhile, none of them a label, a world or another set's."""
    failed: str | None = None
    cpu_s: float
    diagnosis: PublishedDiagnosis | None = None
    """None: it failed."""


class PublishedFollow(Frozen):
    """The verdict with one more gait."""

    failed: str | None = None
    verdict: str
    """Empty where it failed."""
    named: tuple[str, ...] = ()
    first: str = ""
    set90: tuple[str, ...] = ()
    committed: bool


class PublishedFollowed(Frozen):
    """What one more gait in the set's own world changed; both None: no gait was suggested."""

    seed: int
    suggested: PublishedFollow | None = None
    random: PublishedFollow | None = None


class PublishedSet(Frozen):
    """One set."""

    label: dict[str, Any]
    """As it was sealed."""
    salt: str
    verdict: PublishedVerdict
    follow: PublishedFollowed | None = None


class BlindPublished(Frozen):
    """The whole file."""

    format: Format
    tier: Literal["A", "B"]
    bank: str
    made_by: str
    index: str
    """`index.json` of the bank, byte for byte."""
    index_sha256: str
    asked: PublishedAsked
    code: tuple[PublishedCode, ...]
    """What judged, as the verdicts say; several where it changed meanwhile."""
    calibrated: tuple[str, ...]
    """Where the probabilities come from, as the verdicts say."""
    missing: tuple[str, ...]
    """Sets of the bank that have no verdict."""
    sets: dict[str, PublishedSet]
    content_sha256: str
    """Of all else, as JSON with sorted keys and no spaces."""
