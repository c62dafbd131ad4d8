"""The layouts themselves: every column is complete, unambiguous and in SI."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations

import pytest
from pydantic import ValidationError

from schemas.base import DIM_SIZES, ArtifactSpec, DatasetSpec, GroupSpec, column
from schemas.versions import KINDS


def columns(kind: str) -> Iterator[tuple[str, DatasetSpec]]:
    """Path and specification of every column of a kind, of which there is one at least."""
    found = [(f"{group.path}/{spec.path}", spec) for group in KINDS[kind].groups for spec in group.datasets]
    assert found
    yield from found


@pytest.mark.parametrize("kind", KINDS)
def test_columns_are_complete(kind: str) -> None:
    """Meaning without a full stop, codes exactly where the unit is code, NaN for real numbers only."""
    for path, spec in columns(kind):
        assert spec.description and not spec.description.endswith("."), path
        assert bool(spec.codes) == (spec.unit == "code"), path
        assert not spec.nan_means or spec.dtype.startswith("float"), path
        assert spec.unit != "bool" or spec.dtype == "bool", path
        assert spec.dtype != "str" or spec.unit == "1", path


@pytest.mark.parametrize("kind", KINDS)
def test_monograms_name_their_frame(kind: str) -> None:
    """`p_WE` is a position of E in W: what is named so has the frame of its first letter, and 3 or 4 numbers."""
    for path, spec in columns(kind):
        match = re.fullmatch(r"(?:sd_|cov_p_)?([pvwqaX])?_?([A-Z])[A-Z]?", spec.path)
        if match and match.group(1) in ("p", "v", "w"):
            assert spec.frame in (match.group(2), "board") and spec.dims[-1] == "xyz", path
        if match and match.group(1) == "q":
            assert spec.dims[-1] == "quat" and spec.unit == "1", path


@pytest.mark.parametrize("kind", KINDS)
def test_names_are_unique(kind: str) -> None:
    """No two datasets of a group and no two groups of a kind can be confused."""
    spec = KINDS[kind]
    assert spec.kind == kind
    for group in spec.groups:
        for names in ([d.path for d in group.datasets], [a.name for a in group.attributes]):
            assert len(names) == len(set(names))
    for one, two in combinations(spec.groups, 2):
        concrete = [re.sub(r"\{\w+\}", "x", group.path) for group in (one, two)]
        assert not one.matches(concrete[1]) and not two.matches(concrete[0])


def test_kinds_lie_in_different_files() -> None:
    """The name of a file tells the kind."""
    names = [spec.filename for spec in KINDS.values()]
    assert len(names) == len(set(names)) and all(name.endswith(".h5") for name in names)


def test_axes_of_fixed_length_do_not_name_other_axes() -> None:
    """A name of an axis is either of fixed length everywhere or of free length everywhere."""
    assert all(size > 1 for size in DIM_SIZES.values())
    assert {"t", "frame", "cap"}.isdisjoint(DIM_SIZES)


@pytest.mark.parametrize("path", ["runs/x", "runs/a.b-c+1", "runs/Z_9"])
def test_names_of_runs(path: str) -> None:
    """Letters, digits, dot, dash, plus and underscore make a name."""
    assert GroupSpec(path="runs/{run}", description="").matches(path)


@pytest.mark.parametrize(
    "path", ["runs", "runs/", "runs/a/b", "runs/.hidden", "runs/-a", "runs/a b", "runs/a\n", "x/a"]
)
def test_what_is_no_name_of_a_run(path: str) -> None:
    """Nothing that could be an option, a hidden file or another group."""
    assert not GroupSpec(path="runs/{run}", description="").matches(path)


def test_models_refuse_unknown_keys_and_changes() -> None:
    """A misspelt key is an error, and a specification is never changed in place."""
    with pytest.raises(ValidationError):
        column("x", "float64", ("t",), "m", "a length", wanted=True)
    spec = column("x", "float64", ("t",), "m", "a length")
    with pytest.raises(ValidationError):
        spec.unit = "s"


@pytest.mark.parametrize("unit", ["mm", "deg", "", "dm"])
def test_units_are_si(unit: str) -> None:
    """Other units cannot be written down."""
    with pytest.raises(ValidationError):
        column("x", "float64", ("t",), unit, "a length")  # type: ignore[arg-type]


def test_group_finds_its_specification() -> None:
    """The first group that matches a concrete path, or none."""
    spec = KINDS["recording"]
    assert isinstance(spec, ArtifactSpec)
    caps = spec.group("runs/crawl/caps")
    assert caps is not None and caps.dataset("p_WE") is not None and caps.dataset("p_WW") is None
    assert spec.group("runs/crawl/capz") is None
