"""What can still be read of a damaged artifact. Runs in the child process of `store.isolated`."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from r2s2r_cli.store.hashing import PROVENANCE, attributes, blocks, check_dataset, dataset_digest, digest_file, walk
from r2s2r_cli.store.hdf5_errors import meaning

Report = dict[str, Any]


def facts(path: str) -> Report:
    """What the body says about itself, as JSON; nothing is raised for damage.

    `root`: its root attributes. `provenance`: of the record inside, None where it cannot be read. `groups`: attributes
    by group path. `names`: paths of the datasets. `datasets`, `content`, `seal`: digests, empty where anything is
    unreadable. `problem`: why the search ended early, in words.
    """
    found: Report = {
        "root": {}, "provenance": None, "groups": {}, "names": [], "datasets": {}, "content": "", "seal": "",
        "problem": "",
    }  # fmt: skip
    try:
        with h5py.File(path, "r", locking=False) as file:
            _read_facts(file, found)
    except Exception as error:
        found["problem"] = meaning(error)
    return found


def _read_facts(file: h5py.File, found: Report) -> None:
    found["root"] = attributes(file)
    record = file.get(PROVENANCE)
    if isinstance(record, h5py.Group):
        found["provenance"] = {name: json.loads(bytes(node[()])) for name, node in record.items()}
    for name, node in walk(file):
        if name == PROVENANCE or name.startswith(PROVENANCE + "/"):
            continue
        if isinstance(node, h5py.Dataset):
            found["names"].append(name)
        else:
            found["groups"][name] = attributes(node)
    digests = digest_file(file)
    found |= {"datasets": digests.datasets, "content": digests.content, "seal": digests.seal}


def save(path: str, dataset: str, target: str) -> Report:
    """Write one dataset to `target` as a `.npy` file. `digest`: of what was read; `problem`: why it could not be.
    `disk`: number of the error, where it was read and `target` could not be written."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            node = file[dataset]
            if not isinstance(node, h5py.Dataset):
                return {"digest": "", "problem": "a group stands in its place"}
            check_dataset(node)
            digest = dataset_digest(node)
            try:
                with Path(target).open("wb") as out:
                    _write_npy(out, node)
            except OSError as error:  # all of it was read for the digest: what fails now is the disk it is written to
                return {"digest": "", "problem": "", "disk": error.errno or errno.EIO}
            return {"digest": digest, "problem": ""}
    except Exception as error:
        return {"digest": "", "problem": meaning(error)}


def _write_npy(out: Any, node: h5py.Dataset) -> None:
    header = {"descr": node.dtype.str, "fortran_order": False, "shape": node.shape}
    np.lib.format.write_array_header_1_0(out, header)
    for block in blocks(node):
        out.write(np.ascontiguousarray(block).data)
