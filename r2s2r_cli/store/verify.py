"""Is an artifact what its writer sealed? Runs in a child process: damaged HDF5 can crash or hang the library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.hashing import Broken, attributes, blocks, check_dataset, digest_file, plain, walk
from r2s2r_cli.store.hdf5_errors import meaning
from r2s2r_cli.store.header import HDF5_SIGNATURE, MAX_BLOCK, MIN_BLOCK, read_header
from r2s2r_cli.store.layout import check_layout
from schemas.header import Header
from schemas.versions import KINDS

Report = dict[str, Any]
"""JSON: `readable`, `content_ok`, `seal_ok` (bool) and `problems` (list of where, what, expected, received)."""


def verify(path: str) -> Report:
    """Read everything in a file and compare it with its digests and its schema. Never raises for damage."""
    header, problems = _header(Path(path))
    try:
        with h5py.File(path, "r", locking=False) as file:
            return _verify_open(file, header, problems)
    except Exception as error:
        problems.append(_problem("/", meaning(error), "an intact file", _short(error)))
        return {"readable": False, "content_ok": False, "seal_ok": False, "problems": problems}


def tree(path: str) -> Report:
    """What a foreign HDF5 file holds: nodes with shape, dtype and scalar attributes."""
    nodes: list[dict[str, Any]] = []
    try:
        with h5py.File(path, "r", locking=False) as file:
            for path, node in walk(file, strict=False):
                entry: dict[str, Any] = {"path": path, "attributes": {"link": str(node)}}
                if isinstance(node, h5py.Dataset | h5py.Group):
                    entry["attributes"] = _safe_attributes(node)
                if isinstance(node, h5py.Dataset):
                    entry |= {"shape": list(node.shape or ()), "dtype": str(node.dtype)}
                nodes.append(entry)
    except Exception as error:
        return {"nodes": nodes, "problem": meaning(error), "received": _short(error)}
    return {"nodes": sorted(nodes, key=lambda entry: entry["path"]), "problem": "", "received": ""}


def find_body(path: Path) -> int | None:
    """Offset of the HDF5 body: the first power of two from 4096 where its signature stands, or None."""
    if not path.is_file():  # to open a pipe could block for ever
        return None
    offset = MIN_BLOCK
    with path.open("rb") as file:
        while offset <= MAX_BLOCK:
            file.seek(offset)
            if file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                return offset
            offset *= 2
    return None


def _header(path: Path) -> tuple[Header | None, list[dict[str, str]]]:
    try:
        return read_header(path), []
    except ArtifactError as error:
        return None, [_problem("head of the file", error.what, error.expected, error.received)]


def _verify_open(file: h5py.File, header: Header | None, problems: list[dict[str, str]]) -> Report:
    try:
        root = attributes(file)
    except Exception as error:
        problems.append(_problem("/", meaning(error), "readable root attributes", _short(error)))
        return {"readable": False, "content_ok": False, "seal_ok": False, "problems": problems}
    unreadable = _unreadable_nodes(file)
    problems += unreadable
    content_ok = seal_ok = False
    if not unreadable:
        digests = digest_file(file)
        content_ok = digests.content == root.get("content_sha256")
        seal_ok = content_ok and digests.seal == root.get("seal_sha256")
        if header is not None:
            content_ok &= digests.content == header.content_sha256
            seal_ok &= digests.seal == header.seal_sha256
            problems += _changed(header.datasets, digests.datasets)
        if not content_ok and not problems:
            problems.append(_problem("/", "the content hash does not match", str(root.get("content_sha256")),
                                     digests.content))  # fmt: skip
        elif content_ok and not seal_ok:
            problems.append(_problem("/", "a description, header attribute or the provenance was changed",
                                     str(root.get("seal_sha256")), digests.seal))  # fmt: skip
    spec = KINDS.get(str(root.get("kind")))
    if spec is not None and root.get("schema_version") == spec.version and not unreadable:
        problems += [_problem(m.where, m.what, m.expected, m.received) for m in check_layout(file, spec)]
    return {"readable": not unreadable, "content_ok": content_ok, "seal_ok": seal_ok, "problems": problems}


def _unreadable_nodes(file: h5py.File) -> list[dict[str, str]]:
    problems: list[dict[str, str]] = []
    broken: Broken = []
    try:
        for path, node in walk(file, broken=broken):
            problem = _read_through(path, node)
            if problem is not None:
                problems.append(problem)
    except Exception as error:
        problems.append(_problem("/", meaning(error), "a readable tree", _short(error)))
    return problems + [_problem(path, meaning(error), "a readable node", _short(error)) for path, error in broken]


def _read_through(path: str, node: h5py.Dataset | h5py.Group) -> dict[str, str] | None:
    try:
        attributes(node)
        if isinstance(node, h5py.Dataset):
            check_dataset(node)
            for _ in blocks(node):
                pass
    except Exception as error:
        return _problem(path, meaning(error), "readable", _short(error))
    return None


def _changed(expected: dict[str, str], received: dict[str, str]) -> list[dict[str, str]]:
    gone, changed, added = [], [], []
    for path in sorted({**expected, **received}):
        if path not in received:
            gone.append(_problem(path, "a dataset is gone", "the dataset that was sealed", "nothing"))
        elif path not in expected:
            added.append(_problem(path, "a dataset was added after sealing", "nothing", "a dataset"))
        elif expected[path] != received[path]:
            changed.append(_problem(path, "the data changed after sealing", expected[path][:16], received[path][:16]))
    return [*gone, *changed, *added]


def _safe_attributes(node: h5py.Group | h5py.Dataset) -> dict[str, str]:
    found = {}
    for name, value in node.attrs.items():
        try:
            found[name] = str(plain(value))[:200]
        except ValueError:
            found[name] = f"<{type(value).__name__}>"
    return found


def _problem(where: str, what: str, expected: str, received: str) -> dict[str, str]:
    return {"where": where, "what": what, "expected": expected, "received": received}


def _short(error: BaseException) -> str:
    text = " ".join(str(error).split()).strip("'\"")  # a KeyError puts quotes around its message
    return (text or type(error).__name__)[:200]
