"""What is written is what is read, for every kind, size, dtype, NaN and empty axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Rows
from r2s2r_cli.store.read import describe, iter_blobs, read_artifact
from r2s2r_cli.store.write import write_artifact
from schemas.versions import KINDS
from tests.support.builders import BUILDERS, provenance, recording
from tests.support.layouts import filled, same


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_comes_back(tmp_path: Path, kind: str) -> None:
    """The builders' artifacts read back bit by bit, with the header that writing returned."""
    data = BUILDERS[kind]()
    header = write_artifact(tmp_path / "x.h5", data, provenance())
    found, back = read_artifact(tmp_path / "x.h5", kind, blobs=True)
    assert found == header and same(_text_as_bytes(data), back)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(sorted(KINDS)),
    sizes=st.dictionaries(st.text("abcdef", min_size=1, max_size=2), st.integers(0, 7)),
    default=st.integers(0, 5),
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0, 1),
)
def test_any_filling_of_a_layout_comes_back(
    tmp_path: Path, kind: str, sizes: dict[str, int], default: int, seed: int, share: float
) -> None:
    """Random values of random shapes, empty axes, NaN, any subset of what is optional."""
    rng = np.random.default_rng(seed)
    axes: dict[str, int] = {}

    def size(axis: str) -> int:
        return axes.setdefault(axis, default if not sizes else list(sizes.values())[len(axes) % len(sizes)])

    data = filled(KINDS[kind], size, rng, keep=lambda path: bool(rng.random() < share))
    write_artifact(tmp_path / "x.h5", data, provenance())
    _, back = read_artifact(tmp_path / "x.h5", blobs=True)
    assert same(data, back)


def test_blocks_and_whole_arrays_are_the_same_artifact(tmp_path: Path) -> None:
    """An array handed over in blocks gives the file that the whole array gives."""
    data = BUILDERS["simulation"]()
    frames = data.groups["runs/walk/frames"]
    streamed = {
        name: Rows([value[i : i + 5] for i in range(0, len(value), 5)], value.shape, value.dtype)
        for name, value in frames.datasets.items()
        if isinstance(value, np.ndarray)
    }
    groups = {**data.groups, "runs/walk/frames": Group(streamed, frames.attributes)}
    write_artifact(tmp_path / "a.h5", data, provenance())
    write_artifact(tmp_path / "b.h5", ArtifactData("simulation", groups), provenance())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@given(st.lists(st.binary(max_size=300), max_size=12))
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_images_of_any_length_come_back_one_by_one(tmp_path: Path, images: list[bytes]) -> None:
    """Encoded frames, empty ones among them, keep their order and their bytes."""
    count = len(images)
    camera = Group({"t": np.arange(float(count)), "color": Blobs(iter(images), count)}, {"width": 1, "height": 1})
    run = recording().groups["runs/walk"]
    data = ArtifactData("recording", {"runs/walk": run, "runs/walk/camera": camera})
    write_artifact(tmp_path / "x.h5", data, provenance())
    assert list(iter_blobs(tmp_path / "x.h5", "runs/walk/camera", "color")) == images
    _, back = read_artifact(tmp_path / "x.h5", blobs=True)
    assert same(ArtifactData("recording", {**data.groups, "runs/walk/camera": Group(
        {**camera.datasets, "color": Blobs(images, count)}, camera.attributes)}), back)  # fmt: skip


def test_images_are_left_out_unless_asked_for(tmp_path: Path) -> None:
    """Reading an artifact does not read its images."""
    write_artifact(tmp_path / "x.h5", recording(), provenance())
    _, back = read_artifact(tmp_path / "x.h5")
    assert "color" not in back.groups["runs/walk/camera"] and "t" in back.groups["runs/walk/camera"]


def test_description_names_every_node_with_its_unit(tmp_path: Path) -> None:
    """`describe` gives path, shape, unit, frame and meaning of every dataset, without the record inside."""
    write_artifact(tmp_path / "x.h5", recording(), provenance())
    nodes = {node.path: node for node in describe(tmp_path / "x.h5")}
    caps = nodes["runs/walk/caps/p_WE"]
    assert (caps.shape, caps.unit, caps.frame, caps.dims) == ((25, 6, 3), "m", "W", "t_caps,cap,xyz")
    assert nodes["runs/walk"].attributes["robot"] == "threebar"
    assert not any(path.startswith("provenance") for path in nodes)


def _text_as_bytes(data: ArtifactData) -> ArtifactData:
    """Text as it is read: UTF-8 bytes."""
    groups = {
        path: Group(
            {
                n: np.char.encode(v, "utf-8") if isinstance(v, np.ndarray) and v.dtype.kind == "U" else v
                for n, v in group.datasets.items()
            },
            group.attributes,
        )
        for path, group in data.groups.items()
    }
    return ArtifactData(data.kind, groups)
