"""What `effects` prints with --json."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.base import Frozen


class EffectNumber(Frozen):
    """One number of an effect, or one per element."""

    name: str
    unit: str
    per: str
    """robot | rod | cap | cable | actuated | sensor."""
    off: float
    """With this value the effect is not there."""
    lower: float
    upper: float
    prior_sd: float
    what: str
    fitted: bool
    """Whether `identify` can fit it."""


class EffectInfo(Frozen):
    """One effect."""

    id: str
    title: str
    channel: str
    signature: str
    """What it looks like in data, in one sentence."""
    look_alikes: tuple[str, ...]
    numbers: tuple[EffectNumber, ...]
    text: dict[str, str]
    """The headings of its file: what it is, where it acts, source ..."""
    looked_for: bool
    """Whether `diagnose` looks for it without being told to."""
    brought_by: str
    """"" for the catalogue, else the module of an installed package."""


class EffectsResult(Frozen):
    """What `effects` prints."""

    schema_: Literal["r2s2r.effects/1"] = Field(default="r2s2r.effects/1", alias="schema")
    effects: tuple[EffectInfo, ...]
