"""What an interrupted fit and a whole one have in common."""

from __future__ import annotations

from dataclasses import replace

from r2s2r_cli.artifact import ArtifactData


def but_for_rollouts(data: ArtifactData) -> ArtifactData:
    """An identification without the number of simulated windows: where a fit goes on, it linearises once more."""
    fit = data.groups["fit"]
    facts = {name: value for name, value in fit.attributes.items() if name != "rollouts"}
    return replace(data, groups={**data.groups, "fit": replace(fit, attributes=facts)})
