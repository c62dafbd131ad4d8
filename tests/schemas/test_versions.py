"""The chain of migrations from any version to the current one."""

from __future__ import annotations

import pytest

from schemas.base import ArtifactSpec
from schemas.versions import KINDS, MIGRATIONS, STAGE_VERSIONS, NoMigration, chain


def kinds(version: int) -> dict[str, ArtifactSpec]:
    """A world in which the policy's current version is this one."""
    return {"policy": KINDS["policy"].model_copy(update={"version": version})}


STEPS = {("policy", n): (lambda groups, n=n: {**groups, f"step{n}": n}) for n in (1, 2, 3)}


@pytest.mark.parametrize(("start", "end"), [(1, 1), (1, 2), (1, 4), (3, 4), (4, 4)])
def test_chain_goes_through_every_version_once_in_order(start: int, end: int) -> None:
    """The steps from `start` to `end`, each from where the one before ended; none where nothing is to be done."""
    steps = chain("policy", start, kinds=kinds(end), migrations=STEPS)
    assert [version for version, _ in steps] == list(range(start, end))
    groups: dict = {}
    for _, step in steps:
        groups = dict(step(groups))
    assert list(groups) == [f"step{n}" for n in range(start, end)]


def test_no_way_back() -> None:
    """A newer version is refused in words."""
    with pytest.raises(NoMigration, match="version 3 is newer than 2"):
        chain("policy", 3, kinds=kinds(2), migrations=STEPS)


def test_a_hole_in_the_chain_is_named() -> None:
    """The missing step, not the first one."""
    steps = {key: step for key, step in STEPS.items() if key != ("policy", 2)}
    with pytest.raises(NoMigration, match="no step from version 2 to 3 of kind policy"):
        chain("policy", 1, kinds=kinds(4), migrations=steps)


def test_every_earlier_version_of_every_kind_has_its_chain() -> None:
    """What was ever released can be read."""
    for kind, spec in KINDS.items():
        for version in range(1, spec.version + 1):
            assert len(chain(kind, version)) == spec.version - version
    assert all(version < KINDS[kind].version for kind, version in MIGRATIONS)


def test_stage_versions_begin_at_one() -> None:
    """Every stage that writes an artifact has a version to raise."""
    assert STAGE_VERSIONS and all(version >= 1 for version in STAGE_VERSIONS.values())
