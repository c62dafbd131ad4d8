"""How a layout is described: datasets, attributes, groups, artifacts."""

from __future__ import annotations

import functools
import re
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator


class Frozen(BaseModel):
    """Base of every model here: immutable, and an unknown key is an error, not a surprise."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="after")
    def _without_nul(self) -> Self:
        # HDF5 and paths end at one: what stands behind it would be lost, or refused much later.
        for name, value in self.__dict__.items():
            if isinstance(value, str) and "\0" in value:
                raise ValueError(f"no NUL character in {name}")
        return self


Unit = Literal[
    "1", "m", "s", "kg", "N", "N/m", "N/m^2", "N/m^3", "m/s", "m/s^2", "rad", "rad/s", "m^2", "m^4", "kg m^2",
    "F", "F/m", "V", "Hz", "count", "index", "code", "bool", "byte", "unix s", "Pa", "1/s", "px",
]  # fmt: skip
"""Every unit that may stand in an artifact: SI, and the words for what has none."""

DIM_SIZES: dict[str, int] = {"xyz": 3, "xyz2": 3, "quat": 4, "pair": 2, "cubic": 3, "mat4": 4}
"""Axes of fixed length. Other axes (`t_caps`, `cap`, `cable`, `step` ...) have one length a run."""

DType = Literal["float64", "float32", "int64", "int32", "uint64", "uint16", "uint8", "bool", "str", "blobs"]
"""`str` is fixed-length UTF-8 bytes; `blobs` is a sequence of encoded images (two datasets on disk)."""


class DatasetSpec(Frozen):
    """One dataset. `path` is relative to its group."""

    path: str
    dtype: DType
    dims: tuple[str, ...]
    unit: Unit
    description: str
    frame: str = ""
    """Coordinate frame the numbers are expressed in (`W`, `R`, `C`); empty where there is none."""
    required: bool = True
    """Required whenever its group is there."""
    codes: dict[int, str] = Field(default_factory=dict)
    """Meaning of each value, for unit `code`."""
    nan_means: str = ""
    """What NaN stands for; empty: the data must be finite."""


def column(path: str, dtype: DType, dims: tuple[str, ...], unit: Unit, description: str, **more: Any) -> DatasetSpec:
    """Short form of DatasetSpec, for the tables of this package."""
    return DatasetSpec(path=path, dtype=dtype, dims=dims, unit=unit, description=description, **more)


class AttributeSpec(Frozen):
    """One scalar attribute of a group."""

    name: str
    type: Literal["str", "int", "float", "bool"]
    description: str
    unit: Unit = "1"
    required: bool = True
    choices: tuple[str, ...] = ()


class GroupSpec(Frozen):
    """One group. `{run}`-like parts of `path` match any single name."""

    path: str
    description: str
    datasets: tuple[DatasetSpec, ...] = ()
    attributes: tuple[AttributeSpec, ...] = ()
    required: bool = False
    """Required in every run (or, outside runs, in every artifact of the kind)."""

    def matches(self, path: str) -> bool:
        """Whether the concrete group path (`runs/crawl/caps`) is one of this spec's."""
        return _pattern(self.path).fullmatch(path) is not None

    def dataset(self, path: str) -> DatasetSpec | None:
        """The specification of a dataset of this group, by its relative path."""
        return next((d for d in self.datasets if d.path == path), None)


class ArtifactSpec(Frozen):
    """One artifact kind: the version that this code writes, where the file lies, and its groups."""

    kind: str
    version: int
    title: str
    filename: str
    """Name inside the iteration directory or the project (`20-estimate.h5`)."""
    level: Literal["iteration", "project"]
    executed: str | None = None
    """Name of the second artifact of this kind in an iteration, that of the executed plan (`51-estimate.h5`)."""
    groups: tuple[GroupSpec, ...]

    @property
    def filenames(self) -> tuple[str, ...]:
        """All names that artifacts of this kind have."""
        return (self.filename,) if self.executed is None else (self.filename, self.executed)

    def group(self, path: str) -> GroupSpec | None:
        """The specification that a concrete group path falls under, or None."""
        return next((g for g in self.groups if g.matches(path)), None)


@functools.cache
def _pattern(path: str) -> re.Pattern[str]:
    parts = (r"[A-Za-z0-9][\w.+-]*" if part.startswith("{") else re.escape(part) for part in path.split("/"))
    return re.compile("/".join(parts))
