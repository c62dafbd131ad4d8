"""Artifacts that are wrong and sealed all the same: what only `validate` can find."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from r2s2r_cli.store.hashing import digest_file
from r2s2r_cli.store.header import body_sha256, read_header, write_block
from schemas.header import Header


def forge(path: Path, edit: Callable[[h5py.File], object]) -> None:
    """Change the HDF5 body of an artifact and seal it again, as a faulty writer would have."""
    header = read_header(path)
    with h5py.File(path, "r+") as file:
        edit(file)
        digests = digest_file(file)
        for name, text in (("content_sha256", digests.content), ("seal_sha256", digests.seal)):
            file.attrs.modify(name, np.array(text.encode(), dtype=h5py.string_dtype("utf-8", 64)))
    body, length = body_sha256(path, header.body_offset)
    changes: dict[str, Any] = {
        "content_sha256": digests.content, "seal_sha256": digests.seal, "datasets": digests.datasets,
        "body_sha256": body, "body_bytes": length,
    }  # fmt: skip
    write_block(path, header.model_copy(update=changes))


def forge_head(path: Path, **changes: Any) -> Header:
    """Change the sealed head alone; the body stays."""
    header = read_header(path).model_copy(update=changes)
    write_block(path, header)
    return header


def put(dataset: str, place: Any, value: Any) -> Callable[[h5py.File], None]:
    """An edit for `forge`: one value of one dataset."""

    def edit(file: h5py.File) -> None:
        file[dataset][place] = value

    return edit
