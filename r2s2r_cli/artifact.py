"""What an artifact holds, as plain values: groups of arrays and attributes, no file behind them.

Stages return it, `store` writes and reads it, `views` draw it. The layout is fixed by `schemas`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

Scalar = str | int | float | bool


@dataclass(frozen=True)
class Blobs:
    """A sequence of encoded byte strings (PNG, JPEG), one a frame.

    On disk two datasets: `<name>/bytes` uint8 (byte,) and `<name>/offset` uint64 (frame + 1,).
    `items` is re-iterable or a one-shot generator; `count` is known beforehand.
    """

    items: Iterable[bytes]
    count: int


@dataclass(frozen=True)
class Rows:
    """An array too long for memory: its blocks in order along the first axis."""

    blocks: Iterable[np.ndarray]
    shape: tuple[int, ...]
    dtype: np.dtype


Value = np.ndarray | Blobs | Rows


@dataclass(frozen=True)
class Group:
    """One HDF5 group: named arrays (time first) and scalar attributes. Units are those of the schema."""

    datasets: Mapping[str, Value] = field(default_factory=dict)
    attributes: Mapping[str, Scalar] = field(default_factory=dict)

    def __getitem__(self, name: str) -> np.ndarray:
        """The array of dataset `name`; KeyError if absent, TypeError if it is streamed."""
        value = self.datasets[name]
        if not isinstance(value, np.ndarray):
            raise TypeError(f"{name} is streamed, not an array in memory")
        return value

    def __contains__(self, name: str) -> bool:
        return name in self.datasets


@dataclass(frozen=True)
class ArtifactData:
    """One artifact: its kind and its groups by path (`runs/crawl/caps`, no leading slash)."""

    kind: str
    groups: Mapping[str, Group]

    def runs(self) -> list[str]:
        """Names of the runs, in the order of their groups."""
        names = (path.split("/")[1] for path in self.groups if path.startswith("runs/"))
        return list(dict.fromkeys(names))

    def group(self, run: str, stream: str) -> Group | None:
        """Group `stream` of `run`, or None where this run does not have it."""
        return self.groups.get(f"runs/{run}/{stream}")

    def streams(self, run: str) -> Iterator[tuple[str, Group]]:
        """(stream name, group) pairs of one run; the run's own attributes come under the name ''."""
        root = f"runs/{run}"
        for path, group in self.groups.items():
            if path == root or path.startswith(root + "/"):
                yield path[len(root) + 1 :], group
