"""What an earlier identification had free and what it was given, as a request has it."""

from __future__ import annotations

import math

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.free.catalogue import entries, own_entries
from schemas.identification import FIXED_BY_HAND
from schemas.robot import Robot


def specs_of(before: ArtifactData, robot: Robot) -> dict[str, str]:
    """What was free there, as after --free, by name, with the prior before any run. An effect's number that nobody gave
    a start gets none here."""
    group, own = before.groups["parameters"], entries(robot)
    prior_mean, prior_sd = ("first_mean", "first_sd") if "first_sd" in group else ("prior_mean", "prior_sd")
    found = {}
    for k, name in enumerate(names_of(before)):
        if int(group["trust"][k]) == FIXED_BY_HAND:
            continue
        mean, sd = float(group[prior_mean][k]), float(group[prior_sd][k])
        low, high = (float(end) for end in group["bounds"][k])
        start = mean if math.isfinite(mean) else float(group["start"][k])
        known = own[name].free if name in own else None
        beside = known is not None and known.off is not None and start in (known.off, known.start)
        spec = name if beside else f"{name}={start!r}"
        if math.isfinite(low) and math.isfinite(high):
            spec += f",{low!r}..{high!r}"
        # A winch held as others are that came out equal, on a bound say, has a prior of no width: nobody asked for it.
        found[name] = spec + (f",~{sd!r}" if math.isfinite(sd) and sd > 0 else "")
    return found


def given_in(before: ArtifactData, robot: Robot) -> dict[str, float]:
    """What was not free there but had a value of its own, by hand or with the default set, by name, in its unit.
    Without the numbers of effects (`effects_asked.effects_kept` has those)."""
    group, own = before.groups["parameters"], own_entries(robot)
    fixed = zip(names_of(before), group["trust"], group["value"], strict=True)
    return {name: float(value) for name, trust, value in fixed if int(trust) == FIXED_BY_HAND and name in own}


def names_of(before: ArtifactData) -> list[str]:
    """Of its parameters."""
    return [name.decode() for name in before.groups["parameters"]["name"].tolist()]
