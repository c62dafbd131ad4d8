"""A check that crashes on odd data is a bug: every layout that the schema allows, with every sort of number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Value
from r2s2r_cli.checks import CHECKS
from r2s2r_cli.checks.base import run_checks
from r2s2r_cli.checks.schema import FORM
from r2s2r_cli.checks.subjects import Content, policies_of, runs_of
from schemas.base import DIM_SIZES, DatasetSpec, GroupSpec
from schemas.versions import KINDS
from tests.support.check_subjects import robot

ROBOT_AXES = {"cap": 6, "rod": 3, "cable": 9, "actuated": 6, "sensor": 9}
FLOATS = np.array([0.0, -1.0, 1.0, 0.5, 0.2e-12, 1e-300, -1e308, 1e308, np.nan, np.inf, 0.02])


def _array(spec: DatasetSpec, sizes: dict[str, int], random: np.random.Generator, *, right: bool) -> Value:
    """Odd numbers in the right shape; with `right`, only those that the schema allows."""
    if spec.dtype == "blobs":
        count = sizes[spec.dims[0]]
        return Blobs([bytes(random.bytes(3)) for _ in range(count)], count)
    shape = tuple(DIM_SIZES.get(axis, sizes.get(axis, 1)) for axis in spec.dims)
    if spec.dtype == "str":
        return np.array(random.choice([b"a", b"" if right else b"\xff", b""], size=shape), dtype="S1")
    if spec.dtype.startswith("float"):
        allowed = FLOATS if not right else FLOATS[~np.isinf(FLOATS)] if spec.nan_means else FLOATS[np.isfinite(FLOATS)]
        return random.choice(allowed, size=shape)
    if spec.codes and right:
        return random.choice(list(spec.codes), size=shape).astype(spec.dtype)
    if spec.dtype == "bool":
        return random.random(shape) < 0.5
    extreme = np.array([-2, -1, 0, 1, 2, 5, 127] if not spec.dtype.startswith("u") else [0, 1, 2, 255])
    return random.choice(extreme, size=shape).astype(spec.dtype)


def _group(spec: GroupSpec, sizes: dict[str, int], random: np.random.Generator, *, right: bool) -> Group:
    datasets = {
        d.path: _array(d, sizes, random, right=right) for d in spec.datasets if d.required or random.random() < 0.7
    }
    attributes: dict[str, str | int | float | bool] = {}
    for entry in spec.attributes:
        if entry.required or random.random() < 0.7:
            words = entry.choices or ("threebar", "other")
            value = {"str": str(random.choice(words)), "int": int(random.choice([-1, 0, 1, 640])), "bool": True,
                     "float": float(random.choice(FLOATS[:8]))}[entry.type]  # fmt: skip
            attributes[entry.name] = value
    return Group(datasets, attributes)


def _artifact(kind: str, seed: int, *, like_robot: bool, right: bool) -> ArtifactData:
    random = np.random.default_rng(seed)
    axes = {axis for group in KINDS[kind].groups for d in group.datasets for axis in d.dims}
    sizes = {axis: int(random.integers(0, 4)) for axis in sorted(axes)}
    if like_robot:
        sizes |= ROBOT_AXES
    groups = {}
    for spec in KINDS[kind].groups:
        if spec.required or random.random() < 0.8:
            groups[spec.path.replace("{run}", "a").replace("{policy}", "p")] = _group(spec, sizes, random, right=right)
    if "runs/a" in groups:
        groups["runs/a"].attributes["robot"] = "threebar"  # type: ignore[index]
    return ArtifactData(kind, groups)


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 2**32 - 1), like_robot=st.booleans())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None)
def test_no_check_crashes_on_odd_values(kind: str, seed: int, like_robot: bool) -> None:
    """Empty axes, unobserved caps, numbers out of all range: findings in one line each, never an exception."""
    data = _artifact(kind, seed, like_robot=like_robot, right=True)
    content = Content(data)
    assert run_checks(FORM, content, "a.h5") == []
    for subject in (content, *runs_of(data, robot()), *policies_of(data, robot())):
        for finding in run_checks(CHECKS, subject, "a.h5"):
            assert finding.what and "\n" not in finding.received


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None)
def test_the_checks_of_the_form_take_anything(kind: str, seed: int) -> None:
    """NaN, infinities, unknown codes and broken text are found by the checks that guard the others."""
    content = Content(_artifact(kind, seed, like_robot=False, right=False))
    for finding in run_checks(FORM, content, "a.h5"):
        assert finding.location in {
            f"{path}/{name}" for path, group in content.data.groups.items() for name in group.datasets
        }
