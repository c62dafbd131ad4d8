"""HDF5's own messages, translated into what happened, in which file and dataset, and what to run."""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.hashing import ForeignContent

_MEANING: tuple[tuple[str, str], ...] = (
    ("filter returned failure", "a checksum does not match: the stored bytes have changed"),
    ("data error detected by fletcher32", "a checksum does not match: the stored bytes have changed"),
    ("truncated file", "the file was cut off"),
    ("file signature not found", "this is not an HDF5 file"),
    ("unable to lock file", "the file system does not support file locks"),
    ("resource temporarily unavailable", "another program has the file open for writing"),
    ("bad object header", "the file's structure is damaged"),
    ("bad symbol table", "the file's structure is damaged"),
    ("metadata checksum", "the file's structure is damaged"),
    ("can't allocate", "the file asks for an absurd amount of memory: its structure is damaged"),
    ("unable to allocate", "the file asks for an absurd amount of memory: its structure is damaged"),
    ("doesn't exist", "a group or dataset is missing"),
)
_DEFAULT = "the HDF5 library could not read the file: its structure is damaged"


def meaning(error: BaseException) -> str:
    """What an exception of h5py or numpy says about the file, in words."""
    if isinstance(error, ForeignContent):
        return str(error)
    text = str(error).lower()
    return next((words for token, words in _MEANING if token in text), _DEFAULT)


def translate(error: BaseException, path: Path, dataset: str = "") -> ArtifactError:
    """The error to show the user for an h5py exception."""
    return ArtifactError(
        meaning(error),
        where=f"{path}:/{dataset}" if dataset else str(path),
        expected="an intact artifact",
        received=" ".join(str(error).split())[:200] or type(error).__name__,
        hint=f"r2s2r validate {quoted(path)}",
    )
