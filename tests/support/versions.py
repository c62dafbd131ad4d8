"""A made-up artifact kind with three versions, to prove the machinery of migrations on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.store.write import write_artifact
from schemas.base import ArtifactSpec, AttributeSpec, DatasetSpec, GroupSpec, column
from schemas.header import Header
from schemas.versions import KINDS, MIGRATIONS, Groups
from tests.support.builders import provenance

LENGTHS_MM = np.array([100.0, 250.0])
IMAGES = [b"one", b"", b"three" * 1000]


def _spec(version: int, lengths: DatasetSpec, *attributes: AttributeSpec) -> ArtifactSpec:
    images = column("image", "blobs", ("frame",), "byte", "pictures")
    group = GroupSpec(path="runs/{run}", description="a run", datasets=(lengths, images), attributes=attributes,
                      required=True)  # fmt: skip
    return ArtifactSpec(
        kind="toy", version=version, title="toy", filename="90-toy.h5", level="iteration", groups=(group,)
    )


SPECS = {
    1: _spec(1, column("length", "float64", ("cable",), "count", "millimetres, as version 1 had it")),
    2: _spec(2, column("length", "float64", ("cable",), "m", "metres since version 2")),
    3: _spec(3, column("distance", "float64", ("cable",), "m", "called distance since version 3"),
             AttributeSpec(name="origin", type="str", description="required since version 3")),
}  # fmt: skip
"""Version 2 changes a unit; version 3 a name, and demands an attribute."""


def to_metres(groups: Groups) -> Groups:
    """Version 1 to 2."""
    return {p: Group({**g.datasets, "length": g["length"] / 1000}, g.attributes) for p, g in groups.items()}


def to_distance(groups: Groups) -> Groups:
    """Version 2 to 3."""
    changed = {}
    for path, group in groups.items():
        datasets = {"distance" if name == "length" else name: value for name, value in group.datasets.items()}
        changed[path] = Group(datasets, {**group.attributes, "origin": "migrated"})
    return changed


STEPS = {("toy", 1): to_metres, ("toy", 2): to_distance}


@contextmanager
def current(version: int, steps: dict = STEPS) -> Iterator[None]:
    """r2s2r as it was, or will be, when `version` of the toy kind is the newest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(KINDS, "toy", SPECS[version])
        for key, step in steps.items():
            patch.setitem(MIGRATIONS, key, step)
        yield


def write_toy(path: Path, version: int = 1) -> Header:
    """A toy artifact as the r2s2r of that version wrote it."""
    values = {1: {"length": LENGTHS_MM}, 2: {"length": LENGTHS_MM / 1000}, 3: {"distance": LENGTHS_MM / 1000}}[version]
    attributes = {"origin": "migrated"} if version == 3 else {}
    group = Group({**values, "image": Blobs(iter(IMAGES), len(IMAGES))}, attributes)
    with current(version):
        return write_artifact(path, ArtifactData("toy", {"runs/x": group}), provenance())
