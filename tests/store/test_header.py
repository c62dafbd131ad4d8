"""The sealed head: readable without HDF5, and no bit of it changes unnoticed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import ArtifactError, InputError
from r2s2r_cli.store.header import MAGIC, block, block_size, peeked_header, read_header
from r2s2r_cli.store.read import checked_header
from r2s2r_cli.store.write import write_artifact
from tests.store.conftest import Copy
from tests.support.builders import policy, provenance


def flipped(path: Path, bits: Iterator[tuple[int, int]]) -> Iterator[None]:
    """Flip one bit of the file after another, and back."""
    with path.open("r+b", buffering=0) as file:
        content = path.read_bytes()
        for offset, bit in bits:
            os.pwrite(file.fileno(), bytes([content[offset] ^ 1 << bit]), offset)
            yield
            os.pwrite(file.fileno(), content[offset : offset + 1], offset)


def check_flips(path: Path, bits: Iterator[tuple[int, int]]) -> None:
    """Every flip is an error, or the header reads the same."""
    sealed = read_header(path)
    noticed = flips = 0
    for _ in flipped(path, bits):
        flips += 1
        assert peeked_header(path) in (None, sealed)
        try:
            assert read_header(path) == sealed
        except ArtifactError as error:
            noticed += 1
            assert error.where and error.expected and error.received and error.hint
    used = len(block(sealed).rstrip())
    assert noticed > 0.98 * flips * used / sealed.body_offset, "flips of bits that are read went unnoticed"


def test_one_flipped_bit_of_every_byte_is_noticed_or_irrelevant(fresh: Copy) -> None:
    """A changed head is refused, unless only padding changed; never another header."""
    path = fresh("policy")
    check_flips(path, ((i, i * 5 % 8) for i in range(read_header(path).body_offset)))


@pytest.mark.slow
def test_every_flipped_bit_is_noticed_or_irrelevant(fresh: Copy) -> None:
    """The same for all bits of the block."""
    path = fresh("policy")
    check_flips(path, ((i, bit) for i in range(read_header(path).body_offset) for bit in range(8)))


def test_a_head_cut_off_anywhere_is_refused(fresh: Copy) -> None:
    """No length of file short of the whole header gives a header."""
    path = fresh("policy")
    content, used = path.read_bytes(), len(block(read_header(path)).rstrip())
    for length in (*range(0, used, 97), used - 1):
        path.write_bytes(content[:length])
        with pytest.raises(ArtifactError):
            read_header(path)


def test_header_reads_the_same_around_the_edge_of_a_block(tmp_path: Path) -> None:
    """Whatever the length of the header, the body is looked for where it was put.

    The size of the block is fixed before the digests and the length of the body are known; near a power of two the
    finished header would have fitted into half of it.
    """
    path = tmp_path / "policies.h5"
    base = len(block(write_artifact(path, policy(), provenance(), title="x")).rstrip())
    edge = 4096 if base < 4096 else 8192
    offsets = set()
    for title in range(edge - base - 18, edge - base + 4):
        header = write_artifact(path, policy(), provenance(), title="x" * title)
        assert checked_header(path) == header
        offsets.add(header.body_offset)
    assert offsets == {edge, 2 * edge}


def test_a_header_that_would_not_fit_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """More runs than a head can list is an error of the input, and leaves no file."""
    step = Group(
        {"target": np.zeros((1, 1)), "hold": np.zeros(1), "timeout": np.ones(1)}, {"robot": "threebar", "repeat": 1}
    )
    many = ArtifactData("policy", {f"policies/p{i}": step for i in range(20_000)})
    with pytest.raises(InputError, match="too many runs"):
        write_artifact(tmp_path / "policies.h5", many, provenance())
    assert list(tmp_path.iterdir()) == []


def test_block_is_padded_with_spaces_to_a_power_of_two(fresh: Copy) -> None:
    """The block ends with spaces and a newline, so that it can be looked at with `head`."""
    header = read_header(fresh("recording"))
    written = block(header)
    assert len(written) == header.body_offset == block_size(header)
    assert written.startswith(MAGIC) and written.endswith(b" \n")


@pytest.mark.parametrize(
    ("content", "received"),
    [
        (b"", "an empty file"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "an HDF5 file of another program"),
        (b"t_s,cap0_x_m\n0,1\n", "a file that begins b't_s"),
    ],
)
def test_other_files_are_named_for_what_they_are(tmp_path: Path, content: bytes, received: str) -> None:
    """What is no artifact is described by its first bytes."""
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(ArtifactError) as caught:
        read_header(path)
    assert caught.value.received.startswith(received)


def test_a_newer_format_is_not_called_a_foreign_file(golden: Copy) -> None:
    """A head of format 2 is said to be newer or damaged."""
    path = golden("policy")
    path.write_bytes(path.read_bytes().replace(MAGIC, MAGIC.replace(b"1", b"2"), 1))
    with pytest.raises(ArtifactError, match="newer format"):
        read_header(path)


def test_missing_file_directory_and_pipe_are_errors_in_words(tmp_path: Path) -> None:
    """None of the three is a traceback, and the pipe does not hang."""
    os.mkfifo(tmp_path / "pipe")
    for path, what in ((tmp_path / "no.h5", "no such file"), (tmp_path, "directory"), (tmp_path / "pipe", "regular")):
        with pytest.raises(ArtifactError, match=what):
            read_header(path)
