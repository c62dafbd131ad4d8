"""Digests of settings and sources: equal meaning, equal digest."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from r2s2r_cli.store.canonical import canonical_json, file_sha256, folder_sha256, json_sha256, source_sha256

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def reordered(value: Any) -> Any:
    """The same value with the keys of every mapping in reverse order."""
    if isinstance(value, dict):
        return {key: reordered(value[key]) for key in reversed(value)}
    return [reordered(item) for item in value] if isinstance(value, list) else value


@settings(max_examples=40)
@given(VALUES)
def test_order_of_keys_does_not_matter(value: Any) -> None:
    """Two mappings with the same items have the same canonical text."""
    assert canonical_json(value) == canonical_json(reordered(value))


@given(VALUES, VALUES)
def test_equal_text_means_equal_value(one: Any, two: Any) -> None:
    """Canonical texts are equal only where the values are equal in value and type."""
    if canonical_json(one) == canonical_json(two):
        assert repr(reordered(one)) == repr(reordered(two)) or one == two
    else:
        assert json_sha256(one) != json_sha256(two)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_has_no_digest(value: float) -> None:
    """NaN and infinity are refused: no JSON reader would understand them."""
    with pytest.raises(ValueError, match="JSON"):
        canonical_json({"x": value})


def test_folder_digest_follows_names_and_bytes(tmp_path: Path) -> None:
    """Moving bytes between two files, renaming and adding a file all change the digest; a second look does not."""
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "a").write_bytes(b"12")
    (folder / "b").write_bytes(b"3")
    seen = [folder_sha256(folder)]
    assert folder_sha256(folder) == seen[0]
    (folder / "a").write_bytes(b"1")
    (folder / "b").write_bytes(b"23")
    seen.append(folder_sha256(folder))
    (folder / "b").rename(folder / "c")
    seen.append(source_sha256(folder))
    (folder / "d").touch()
    seen.append(folder_sha256(folder))
    assert len(set(seen)) == 4


def test_folder_may_hold_names_that_are_not_text(tmp_path: Path) -> None:
    """A file name that is not UTF-8 counts like any other."""
    before = folder_sha256(tmp_path)
    (tmp_path / os.fsdecode(b"\xff.png")).write_bytes(b"x")
    assert folder_sha256(tmp_path) != before


def test_a_pipe_has_no_digest(tmp_path: Path) -> None:
    """A pipe is an error instead of an endless wait."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="regular"):
        file_sha256(tmp_path / "pipe")
