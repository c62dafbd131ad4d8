"""A recorded run of a blind set in one `.npz`: streams of `schemas/recording.py`, pictures as `record` encodes them.

HDF5, in which `record` keeps the same, is opened by a C library of its own, and the guard would not hear of it.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.errors import InputError

SUFFIX = ".npz"
_ATTRIBUTES = "attributes"
_BYTES, _OFFSET = "/bytes", "/offset"
"""Of encoded pictures, as in an artifact: all bytes, and where each picture begins."""


@dataclass(frozen=True)
class Recorded:
    """data: a recording of one run, without its pictures, which `pictures` gives as `estimate` asks for them."""

    data: ArtifactData
    encoded: Mapping[str, EncodedPictures]

    def pictures(self, run: str, name: str) -> EncodedPictures | None:
        """`color` or `depth` of the run's camera; None where there are none."""
        return self.encoded.get(f"camera/{name}") if run in self.data.runs() else None


@dataclass(frozen=True)
class EncodedPictures:
    """Pictures by their number. data: uint8 (byte,). offset: where each begins, (picture + 1,)."""

    data: np.ndarray
    offset: np.ndarray

    def __len__(self) -> int:
        return len(self.offset) - 1

    def __getitem__(self, index: int) -> bytes:
        """PNG or JPEG."""
        return bytes(self.data[int(self.offset[index]) : int(self.offset[index + 1])])


def write_recording(path: Path, streams: Mapping[str, Group]) -> None:
    """streams: groups of one run by name, the run itself under ''. Equal streams give equal bytes."""
    arrays: dict[str, np.ndarray] = {}
    for stream, group in streams.items():
        for name, value in group.datasets.items():
            if isinstance(value, Blobs):
                items = list(value.items)
                arrays[f"{stream}/{name}{_BYTES}"] = np.frombuffer(b"".join(items), np.uint8)
                arrays[f"{stream}/{name}{_OFFSET}"] = np.cumsum([0, *(len(one) for one in items)], dtype=np.uint64)
            else:
                arrays[f"{stream}/{name}"] = group[name]
    said = {stream: dict(group.attributes) for stream, group in streams.items() if group.attributes}
    arrays[_ATTRIBUTES] = np.array(json.dumps(said, sort_keys=True))
    # Not compressed: of its bytes nearly all are pictures, which are.
    np.savez(path, allow_pickle=False, **arrays)


def read_recording(path: Path) -> Recorded:
    """The run that was written, named by its stem. Raises InputError where the file is none."""
    try:
        # From bytes: of a file that is cut off NumPy loses the handle.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        said = json.loads(str(arrays.pop(_ATTRIBUTES)))
        whole = [name.removesuffix(_BYTES) for name in arrays if name.endswith(_BYTES)]
        encoded = {name: EncodedPictures(arrays.pop(name + _BYTES), arrays.pop(name + _OFFSET)) for name in whole}
    except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise InputError(
            "a recorded run of a set cannot be read", where=str(path), expected="an .npz of `blind make --camera`",
            received=str(error).splitlines()[0], hint="r2s2r blind make --camera bank --key labels.key",
        ) from error  # fmt: skip
    datasets: dict[str, dict[str, np.ndarray]] = {stream: {} for stream in said}
    for name, value in arrays.items():
        stream, _, dataset = name.rpartition("/")
        datasets.setdefault(stream, {})[dataset] = value
    root = f"runs/{path.stem}"
    groups = {
        f"{root}/{stream}".rstrip("/"): Group(datasets=found, attributes=said.get(stream, {}))
        for stream, found in datasets.items()
    }
    return Recorded(ArtifactData(kind="recording", groups=groups), encoded)
