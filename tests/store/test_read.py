"""Reading trusts nothing: bytes are compared with the seal before HDF5 sees them."""

from __future__ import annotations

import shlex
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

from r2s2r_cli.errors import ArtifactError, DamageWarning
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.newer import newer_r2s2r
from r2s2r_cli.store.read import checked_header, load, read_artifact
from r2s2r_cli.store.write import write_artifact
from schemas.versions import KINDS
from tests.store.conftest import Copy
from tests.support.builders import policy, provenance
from tests.support.layouts import same
from tests.support.soak import drawn


def refused(path: Path, kind: str | None = None) -> ArtifactError:
    """The error that reading raises."""
    before = path.read_bytes()
    with pytest.raises(ArtifactError) as caught:
        read_artifact(path, kind)
    assert path.read_bytes() == before
    assert caught.value.where and caught.value.expected and caught.value.received and caught.value.hint
    return caught.value


def edit(path: Path, name: str, value: object) -> None:
    """Change a dataset as another HDF5 program would."""
    with h5py.File(path, "r+") as file:
        file[name][...] = value


def test_a_changed_number_is_named_by_its_dataset(golden: Copy) -> None:
    """Another program wrote into a dataset: the error names it."""
    path = golden("simulation")
    edit(path, "runs/walk/frames/tension", 7.0)
    error = refused(path)
    assert error.what == "the data changed after sealing" and error.where.endswith("runs/walk/frames/tension")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda f: f["runs/walk/frames/t"].attrs.modify("unit", np.bytes_("ms")), "data changed"),
        (lambda f: f["runs/walk/frames/t"].attrs.modify("description", np.bytes_("mine")), "description"),
        (lambda f: f["runs/walk"].attrs.modify("engine", np.bytes_("other")), "content hash"),
        (lambda f: f["provenance/argv"].write_direct(np.array(b"[]", f["provenance/argv"].dtype)), "provenance"),
        (lambda f: f.move("runs/walk", "runs/run"), "gone"),
        (lambda f: f.__delitem__("runs/walk/policy/hold"), "gone"),
        (lambda f: f.__setitem__("runs/walk/policy/more", 1.0), "added"),
        (lambda f: f.attrs.modify("content_sha256", np.bytes_("0" * 64)), "content hash"),
        (lambda f: f.attrs.__setitem__("note", "hello"), "changed"),
        (lambda f: f["runs/walk"].attrs.__setitem__("list", [1, 2]), "single values"),
        (lambda f: f["runs/walk"].attrs.__setitem__("step", np.nan), "finite"),
    ],
)  # fmt: skip
def test_every_edit_by_another_program_is_refused(golden: Copy, change: object, what: str) -> None:
    """Units, descriptions, attributes, the record, names, additions, deletions: each breaks the seal, in words."""
    path = golden("simulation")
    with h5py.File(path, "r+") as file:
        change(file)  # type: ignore[operator]
    assert what in refused(path).what


def test_bytes_that_nothing_reads_are_a_warning(golden: Copy) -> None:
    """Bytes appended behind the data change nothing that can be read: content and values are the same."""
    path = golden("policy")
    _, before = read_artifact(path)
    with path.open("ab") as file:
        file.write(b"tail")
    with pytest.warns(DamageWarning, match="content hash still holds"):
        _, after = read_artifact(path)
    assert same(before, after)


def test_a_file_cut_off_says_so(golden: Copy) -> None:
    """Expected and received length are given."""
    path = golden("policy")
    path.write_bytes(path.read_bytes()[:-100])
    error = refused(path)
    assert "cut off" in error.what and error.hint == f"r2s2r recover {path}"


def test_another_kind_is_refused(golden: Copy) -> None:
    """A simulation is not read as an estimate."""
    error = refused(golden("simulation"), "estimate")
    assert (error.expected, error.received) == ("estimate", "simulation")


def test_a_newer_version_is_refused_with_the_way_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An artifact of tomorrow asks for tomorrow's r2s2r."""
    newer = KINDS["policy"].model_copy(update={"version": KINDS["policy"].version + 1})
    with monkeypatch.context() as patch:
        patch.setitem(KINDS, "policy", newer)
        write_artifact(tmp_path / "policies.h5", policy(), provenance())
    error = refused(tmp_path / "policies.h5")
    assert "newer" in error.received and error.hint == newer_r2s2r()


def test_an_unknown_kind_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An artifact of a kind that only a newer r2s2r knows is not called damaged."""
    with monkeypatch.context() as patch:
        patch.setitem(KINDS, "gap", KINDS["policy"].model_copy(update={"kind": "gap"}))
        data = policy()
        write_artifact(tmp_path / "gap.h5", type(data)("gap", data.groups), provenance())
    error = refused(tmp_path / "gap.h5")
    assert (error.received, error.hint) == ("gap", newer_r2s2r())


@pytest.mark.parametrize("cloned", [True, False])
def test_a_newer_r2s2r_comes_from_the_clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cloned: bool) -> None:
    """Its folder as a shell takes it; where r2s2r is not run from a clone, the command is for one. No index has it."""
    root = tmp_path / "my clone"
    (root / "r2s2r_cli" / "store").mkdir(parents=True)
    (root / ".git").mkdir()
    if cloned:
        (root / "pyproject.toml").touch()
    monkeypatch.setattr("r2s2r_cli.store.newer.__file__", str(root / "r2s2r_cli" / "store" / "newer.py"))
    words = shlex.split(newer_r2s2r(), comments=True)
    where = ["-C", str(root)] if cloned else []
    assert words == ["git", *where, "pull", "&&", "pip", "install", "-e", str(root) if cloned else "."]


def test_swapping_the_bodies_of_two_artifacts_is_noticed(golden: Copy) -> None:
    """A sound head before another artifact's sound body is refused."""
    one, two = golden("policy"), golden("simulation")
    cut = read_header(one).body_offset
    one.write_bytes(one.read_bytes()[:cut] + two.read_bytes()[read_header(two).body_offset :])
    assert refused(one).what


def check_flips(path: Path, reader: IsolatedReader, count: int, seed: int) -> None:
    """Each of `count` bits spread over the body: refused, or warned about with every value unchanged."""
    original, (_, before) = path.read_bytes(), read_artifact(path, blobs=True)
    start = read_header(path).body_offset
    refusals = 0
    for offset in np.random.default_rng(seed).integers(start, len(original), count).tolist():
        damaged = bytearray(original)
        damaged[offset] ^= 1 << offset % 8
        path.write_bytes(damaged)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DamageWarning)
            try:
                header = checked_header(path, reader=reader)
            except ArtifactError as error:
                refusals += 1
                assert error.what and error.received and error.hint
                continue
        assert same(before, load(path, header, blobs=True))
    assert refusals


@pytest.mark.parametrize("kind", KINDS)
def test_flipped_bits_of_the_body_are_noticed_or_unread(golden: Copy, reader: IsolatedReader, kind: str) -> None:
    """Six bits of every kind."""
    check_flips(golden(kind), reader, 6, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_flipped_bits_of_the_body_are_noticed_or_unread(golden: Copy, reader: IsolatedReader, kind: str) -> None:
    """The same of a dozen others, in a soak test of forty."""
    check_flips(golden(kind), reader, drawn(12, 40), seed=1)
