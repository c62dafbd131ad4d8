"""The content hash: equal content, equal hash, whenever, wherever and in whatever order it was written."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.write import write_artifact
from schemas.versions import KINDS
from tests.support.builders import BUILDERS, policy, provenance, recording
from tests.support.layouts import filled, materialised

IN_A_FOLDER = settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def content(tmp_path: Path, data: ArtifactData, **changes: object) -> str:
    """Content hash of `data` as written."""
    return write_artifact(tmp_path / "x.h5", data, provenance(**changes)).content_sha256


def one_policy(**replaced: object) -> ArtifactData:
    """A policy artifact with one policy, some of its values replaced."""
    values = {"target": np.array([[0.5, 1.0]]), "hold": np.array([0.0]), "timeout": np.array([np.nan]), **replaced}
    repeat = values.pop("repeat", 1)
    return ArtifactData("policy", {"policies/p": Group(values, {"robot": "threebar", "repeat": repeat})})  # type: ignore[dict-item]


@pytest.mark.parametrize("kind", KINDS)
def test_times_arguments_and_machine_are_left_out(tmp_path: Path, kind: str) -> None:
    """Another start, duration, command line, machine and commit give the same content hash, and another seal."""
    data = BUILDERS[kind]
    first = write_artifact(tmp_path / "a.h5", data(), provenance())
    other = provenance(started="2031-01-01T00:00:00+00:00", wall_s=9.0, argv=("x",), platform="moon", commit="f" * 40)
    second = write_artifact(tmp_path / "b.h5", data(), other)
    assert first.content_sha256 == second.content_sha256
    assert first.seal_sha256 != second.seal_sha256


@pytest.mark.parametrize("kind", KINDS)
def test_equal_artifacts_are_equal_files(tmp_path: Path, kind: str) -> None:
    """With the same provenance as well, every byte of the file is the same."""
    for name in ("a.h5", "b.h5"):
        write_artifact(tmp_path / name, BUILDERS[kind](), provenance())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@IN_A_FOLDER
@given(st.sampled_from(sorted(KINDS)), st.integers(0, 2**32 - 1), st.randoms(use_true_random=False))
def test_order_of_writing_does_not_matter(tmp_path: Path, kind: str, seed: int, order: object) -> None:
    """Groups, datasets and attributes handed over in another order give the same hash."""
    rng = np.random.default_rng(seed)
    data = filled(KINDS[kind], lambda axis: 3, rng, keep=lambda path: True)

    def shuffled(mapping: object) -> dict:
        items = list(mapping.items())  # type: ignore[attr-defined]
        order.shuffle(items)  # type: ignore[attr-defined]
        return dict(items)

    groups = {p: Group(shuffled(g.datasets), shuffled(g.attributes)) for p, g in shuffled(data.groups).items()}
    assert content(tmp_path, ArtifactData(kind, groups)) == content(tmp_path, data)


@IN_A_FOLDER
@given(st.integers(0, 2**32 - 1), st.data())
def test_one_other_value_gives_another_hash(tmp_path: Path, seed: int, draw: st.DataObject) -> None:
    """Whichever number of whichever dataset changes by one bit, the hash changes."""
    data = filled(KINDS["simulation"], lambda axis: 2, np.random.default_rng(seed), keep=lambda path: True)
    before = content(tmp_path, data)
    arrays = [(p, n, v) for p, g in data.groups.items() for n, v in g.datasets.items() if isinstance(v, np.ndarray)]
    path, name, array = draw.draw(st.sampled_from(arrays))
    changed = array.copy()
    byte = draw.draw(st.integers(0, changed.nbytes - 1))
    changed.view(np.uint8).reshape(-1)[byte] ^= 1  # bool: 0 and 1 swap
    group = data.groups[path]
    groups = {**data.groups, path: Group({**group.datasets, name: changed}, group.attributes)}
    assert content(tmp_path, ArtifactData("simulation", groups)) != before


def test_each_kind_of_change_is_seen(tmp_path: Path) -> None:
    """Another attribute, run name, text, image and sign of zero each give a hash of their own."""
    base = one_policy()
    images = [Blobs(frames, 2) for frames in ([b"ab", b"c"], [b"a", b"bc"])]  # the same bytes, cut elsewhere

    def camera(blobs: Blobs) -> ArtifactData:
        run = recording().groups["runs/walk"]
        frames = Group({"t": np.arange(2.0), "color": blobs}, {"width": 1, "height": 1})
        return ArtifactData("recording", {"runs/walk": run, "runs/walk/camera": frames})

    variants = [
        base, one_policy(repeat=2), one_policy(hold=np.array([-0.0])), one_policy(timeout=np.array([1.0])),
        ArtifactData("policy", {"policies/q": base.groups["policies/p"]}), camera(images[0]), camera(images[1]),
    ]  # fmt: skip
    assert len({content(tmp_path, variant) for variant in variants}) == len(variants)


def test_the_same_content_in_other_clothes(tmp_path: Path) -> None:
    """Width and encoding of text, whole numbers for real ones and numpy scalars make no difference."""
    path = "calibration"
    lines = BUILDERS[path]()
    plain = content(tmp_path, lines)
    group = lines.groups["lines"]
    wide = Group({**group.datasets, "name": np.array([b"bench"], dtype="S40")}, group.attributes)
    tendons = lines.groups["tendons"]
    numbers = Group(tendons.datasets, {**tendons.attributes, "k1_mean": 310, "x_common": np.float64(0.05)})  # type: ignore[dict-item]
    assert tendons.attributes["k1_mean"] == 310.0
    assert content(tmp_path, ArtifactData(path, {**lines.groups, "lines": wide, "tendons": numbers})) == plain


def test_hash_stands_in_the_body_for_other_programs(tmp_path: Path) -> None:
    """Kind, version and content hash are root attributes that any HDF5 program shows."""
    header = write_artifact(tmp_path / "policies.h5", policy(), provenance())
    with h5py.File(tmp_path / "policies.h5", "r") as file:
        root = {name: bytes(value).decode() for name, value in file.attrs.items() if name != "schema_version"}
        assert root["kind"] == "policy" and file.attrs["schema_version"] == KINDS["policy"].version
    assert root["content_sha256"] == read_header(tmp_path / "policies.h5").content_sha256 == header.content_sha256


def test_materialised_sees_every_value() -> None:
    """The comparison that other tests rest on tells images, arrays and attributes apart."""
    assert materialised(recording())["runs/walk/camera"]["color"][0].startswith(b"\x89PNG")
