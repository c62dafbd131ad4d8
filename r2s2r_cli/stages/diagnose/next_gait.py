"""What to run next: the gait that separates the remaining candidates most."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.which.which import Compared


@dataclass(frozen=True)
class GaitLibrary:
    """Policies that can be suggested: target vectors (step, actuated) by name, as `record --policy` takes them."""

    gaits: dict[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class NextGait:
    """name, targets: the policy. separates: pairs of candidates with the nats that it tells them apart by. nats: the
    smallest of these; now: the same of the gaits that were run."""

    name: str
    targets: tuple[tuple[float, ...], ...]
    separates: tuple[tuple[str, str, float], ...]
    nats: float
    now: float | None


def next_gait(
    evidence: Evidence, compared: Compared, library: GaitLibrary, *, told: Callable[[str, int, int], None]
) -> NextGait | None:
    """None where there is nothing left to separate, or no gait to choose from."""
    del evidence, compared, library, told
    return None
