"""Encoded pictures of an artifact by their number: any of them at once, from any thread, none kept in memory."""

from __future__ import annotations

import threading
from pathlib import Path
from types import TracebackType
from typing import Self

import h5py
import numpy as np

from r2s2r_cli.store.hdf5_errors import translate
from r2s2r_cli.store.layout import BLOB_BYTES, BLOB_OFFSET


class PictureFile:
    """An artifact that has been checked (`read_artifact`), open for its pictures: `with PictureFile(path) as file:`."""

    def __init__(self, path: Path) -> None:
        """Raises ArtifactError where it cannot be opened."""
        self.path, self.lock = path, threading.Lock()
        try:
            self._file = h5py.File(path, "r", locking=False)
        except (OSError, RuntimeError) as error:
            raise translate(error, path) from error

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close; pictures cannot be read any more."""
        with self.lock:
            self._file.close()

    def pictures(self, dataset: str) -> Pictures | None:
        """Those of `runs/<run>/camera/color` and the like; None where there are none. Raises ArtifactError."""
        try:
            with self.lock:
                node = self._file.get(dataset)
                if not isinstance(node, h5py.Group) or set(node) != {BLOB_BYTES, BLOB_OFFSET}:
                    return None
                return Pictures(self, node[BLOB_BYTES], node[BLOB_OFFSET][()])
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            raise translate(error, self.path) from error


class Pictures:
    """Encoded pictures in their order; `pictures[k]` reads one."""

    def __init__(self, file: PictureFile, data: h5py.Dataset, offset: np.ndarray) -> None:
        self._of, self._data, self._offset = file, data, offset.astype(np.int64)

    def __len__(self) -> int:
        return len(self._offset) - 1

    def __getitem__(self, index: int) -> bytes:
        """PNG or JPEG. Raises ArtifactError."""
        start, stop = int(self._offset[index]), int(self._offset[index + 1])
        try:
            with self._of.lock:
                data = np.asarray(self._data[start:stop])
        except (OSError, RuntimeError, ValueError) as error:
            raise translate(error, self._of.path) from error
        return data.tobytes()
