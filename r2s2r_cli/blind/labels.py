"""Sealed labels: salted, committed to by SHA-256 before anything is diagnosed, encrypted, opened by `score` alone.

A bank: `index.json` (names of the sets, the commitment of every label, a digest of every set's logs), `sets/<name>/`,
`labels/<name>.sealed`, and what it was begun with, sealed too (`make/begun.py`). The key is a file that lies elsewhere.
Encryption is Fernet of `cryptography` (ADR 13).
"""

from __future__ import annotations

import hmac
import json
import secrets
from hashlib import sha256
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import InputError, UsageError

INDEX, SETS, LABELS = "index.json", "sets", "labels"
_SALT_BYTES = 32
FIND_KEY = "find . -name '*.key'   # --key takes the one that `r2s2r blind make --key` wrote"


def new_key(path: Path) -> bytes:
    """A new key in a new file that its owner alone may read. Raises UsageError where the file is there already."""
    from cryptography.fernet import Fernet

    key = Fernet.generate_key()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o600, exist_ok=False)
    except FileExistsError as error:
        raise UsageError(
            "a key is never overwritten: labels that it sealed could not be opened again", where=str(path),
            expected="no such file", received="a file", hint=f"r2s2r blind make --key {path}.2",
        ) from error  # fmt: skip
    path.write_bytes(key + b"\n")
    return key


def read_key(path: Path) -> bytes:
    """The key of a file. Raises InputError where it is none."""
    from cryptography.fernet import Fernet

    try:
        key = path.read_bytes().strip()
        Fernet(key)
    except (OSError, ValueError) as error:
        raise InputError(
            "the key of the labels cannot be read", where=str(path), expected="the file that `blind make --key` wrote",
            received=str(error), hint=FIND_KEY,
        ) from error  # fmt: skip
    return key


def set_name(key: bytes, number: int) -> str:
    """Name of a bank's set: nobody without the key can tell which number it has."""
    return hmac.new(key, f"set {number}".encode(), sha256).hexdigest()[:12]


def secret(key: bytes, what: str) -> int:
    """A large number that only the key decides."""
    return int.from_bytes(hmac.new(key, what.encode(), sha256).digest()[:8], "big")


def seal(label: dict[str, Any], key: bytes) -> tuple[bytes, str]:
    """The encrypted label, and the commitment: SHA-256 of the label with its salt."""
    from cryptography.fernet import Fernet

    text = plain_text(label, secrets.token_hex(_SALT_BYTES))
    return Fernet(key).encrypt(text), sha256(text).hexdigest()


def opened(sealed: bytes, key: bytes, commitment: str, *, where: str) -> dict[str, Any]:
    """The label. Raises InputError where the key is another, or the label is not the one that was committed to."""
    return unsealed(sealed, key, commitment, where=where)[0]


def unsealed(sealed: bytes, key: bytes, commitment: str, *, where: str) -> tuple[dict[str, Any], str]:
    """The label and its salt. Raises as `opened`."""
    text = plain(sealed, key, where=where)
    check(text, commitment, where=where)
    found = json.loads(text)
    return found["label"], found["salt"]


def plain(sealed: bytes, key: bytes, *, where: str) -> bytes:
    """What was sealed, not yet compared with a commitment. Raises InputError where the key is another."""
    from cryptography.fernet import Fernet, InvalidToken

    try:
        return Fernet(key).decrypt(sealed)
    except InvalidToken as error:
        raise InputError(
            "a label cannot be opened with this key", where=where, expected="the key that sealed it",
            received="another key, or a damaged file", hint=FIND_KEY,
        ) from error  # fmt: skip


def plain_text(label: dict[str, Any], salt: str) -> bytes:
    """What is committed to: everybody who is told label and salt can make it again."""
    return json.dumps({"salt": salt, "label": label}, sort_keys=True).encode()


def check(text: bytes, commitment: str, *, where: str) -> None:
    """Raises InputError where the text of a label is not the one that was committed to."""
    found = sha256(text).hexdigest()
    if found != commitment:
        raise InputError(
            "a label is not the one that was committed to", where=where, expected=commitment, received=found,
            hint="r2s2r blind make bank --key labels.key   # these figures cannot be trusted",
        )  # fmt: skip


def commitment_of(sealed: bytes, key: bytes) -> str:
    """What a label sealed earlier was committed to with, for a maker that goes on. Raises as Fernet does."""
    from cryptography.fernet import Fernet

    return sha256(Fernet(key).decrypt(sealed)).hexdigest()
