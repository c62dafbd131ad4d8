"""Shards of a bank: other sets from another number on, and never two shards in one folder."""

from __future__ import annotations

from pathlib import Path

import pytest
from cryptography.fernet import Fernet

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import read_index
from r2s2r_cli.blind.make.bank import Asked, make, sealed, worlds
from r2s2r_cli.blind.make.begun import RECORD
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import UsageError

KEY = Fernet.generate_key()


def asked(out: Path, first: int | None, *, bank: Bank = Bank.CALIBRATION, count: int = 12, key: bytes = KEY) -> Asked:
    """A shard."""
    return Asked(bank, count, out, key, first)


def test_shards_have_other_worlds_with_shares_of_their_own(tmp_path: Path) -> None:
    """Sets 0 .. 11 and 12 .. 23 share no seed; each holds every kind; from 0 on is what it is without a number."""
    shards = [worlds(asked(tmp_path, first)) for first in (0, 12)]
    assert [[one.seed for one in shard] for shard in shards] == [
        list(range(100_000, 100_012)),
        list(range(100_012, 100_024)),
    ]
    for shard in shards:
        assert sorted(str(one.kind) for one in shard).count("single") == 7 and len({one.kind for one in shard}) == 4
    assert [one.seed for one in worlds(asked(tmp_path, None))] == [one.seed for one in shards[0]]


def test_of_a_blind_bank_the_key_decides_unless_asked(tmp_path: Path) -> None:
    """Another key, other worlds; a number that is given is kept."""
    other = Fernet.generate_key()
    first = [worlds(asked(tmp_path, None, bank=Bank.BLIND, key=key))[0].seed for key in (KEY, KEY, other)]
    assert first[0] == first[1] != first[2]
    assert worlds(asked(tmp_path, 7, bank=Bank.BLIND))[0].seed == 500_007


def test_two_shards_never_lie_in_one_folder(tmp_path: Path) -> None:
    """What is there is gone on with where it is of the same worlds, and refused where not: the names are equal."""
    shard = asked(tmp_path, 12, count=2)
    for number, world in enumerate(worlds(shard)):
        path = sealed(tmp_path, labels.set_name(KEY, number))
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(labels.seal({"seed": world.seed, "observed": 0}, KEY)[0])
    assert len(list(make(shard))) == len(read_index(tmp_path / labels.INDEX)[0]["sets"]) == 2
    (tmp_path / RECORD).unlink()  # as a version before left it
    with pytest.raises(UsageError, match="another bank"):
        list(make(asked(tmp_path, 0, count=2)))
    with pytest.raises(UsageError, match="another bank"):
        list(make(Asked(Bank.CALIBRATION, 2, tmp_path, KEY, 12, observed=1)))
