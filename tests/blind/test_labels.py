"""Labels stay shut until they are scored, and cannot be exchanged meanwhile."""

from pathlib import Path

import pytest

from r2s2r_cli.blind import labels
from r2s2r_cli.errors import InputError, UsageError

LABEL = {"kind": "single", "effects": [{"id": "payload"}], "d": 9.5}


def test_a_label_comes_back_with_its_key_alone(tmp_path: Path) -> None:
    """Another key opens nothing, and nothing of the label can be read from what is sealed."""
    key = labels.new_key(tmp_path / "k.key")
    sealed, commitment = labels.seal(LABEL, key)
    assert labels.opened(sealed, labels.read_key(tmp_path / "k.key"), commitment, where="here") == LABEL
    assert b"payload" not in sealed and commitment == labels.commitment_of(sealed, key)
    with pytest.raises(InputError, match="cannot be opened"):
        labels.opened(sealed, labels.new_key(tmp_path / "other.key"), commitment, where="here")


def test_equal_labels_have_different_commitments() -> None:
    """The salt: a list of guesses cannot be hashed and compared."""
    from cryptography.fernet import Fernet

    key = Fernet.generate_key()
    assert labels.seal(LABEL, key)[1] != labels.seal(LABEL, key)[1]


def test_a_label_that_was_exchanged_is_refused(tmp_path: Path) -> None:
    """Sealed with the right key, but not what was committed to before the run."""
    key = labels.new_key(tmp_path / "k.key")
    _, commitment = labels.seal(LABEL, key)
    other, _ = labels.seal({**LABEL, "d": 2.0}, key)
    with pytest.raises(InputError, match="committed to"):
        labels.opened(other, key, commitment, where="here")


def test_names_tell_nothing_and_a_key_is_never_overwritten(tmp_path: Path) -> None:
    """The same number has another name under another key."""
    a, b = labels.new_key(tmp_path / "a.key"), labels.new_key(tmp_path / "b.key")
    assert labels.set_name(a, 3) == labels.set_name(a, 3) != labels.set_name(b, 3)
    assert (tmp_path / "a.key").stat().st_mode & 0o077 == 0
    with pytest.raises(UsageError, match="never overwritten"):
        labels.new_key(tmp_path / "a.key")
    (tmp_path / "c.key").write_text("no key")
    with pytest.raises(InputError, match="cannot be read"):
        labels.read_key(tmp_path / "c.key")
