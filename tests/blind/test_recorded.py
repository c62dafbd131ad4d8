"""A recorded run of a set on disk: what was written comes back, and nothing of another kind is taken for one."""

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import Blobs, Group
from r2s2r_cli.blind.recorded import read_recording, write_recording
from r2s2r_cli.errors import InputError

PICTURES = [b"first", b"", b"the third"]


def streams() -> dict[str, Group]:
    """Two streams and the run itself."""
    return {
        "": Group(attributes={"robot": "threebar", "pid_p": 2.5}),
        "commands": Group({"t": np.arange(3.0), "target": np.ones((3, 6))}),
        "camera": Group({"t": np.arange(3.0), "color": Blobs(PICTURES, 3)}, {"width": 640}),
    }


def test_a_recording_comes_back(tmp_path: Path) -> None:
    """Arrays, attributes and pictures, under the name of the file; equal streams are equal bytes."""
    for name in ("g1", "g2"):
        write_recording(tmp_path / f"{name}.npz", streams())
    assert (tmp_path / "g1.npz").read_bytes() == (tmp_path / "g2.npz").read_bytes()
    found = read_recording(tmp_path / "g1.npz")
    assert found.data.kind == "recording" and found.data.runs() == ["g1"]
    groups = dict(found.data.streams("g1"))
    assert groups[""].attributes == {"robot": "threebar", "pid_p": 2.5} and groups["camera"].attributes["width"] == 640
    assert np.array_equal(groups["commands"]["target"], np.ones((3, 6)))
    color = found.pictures("g1", "color")
    assert color is not None and [color[k] for k in range(len(color))] == PICTURES
    assert found.pictures("g1", "depth") is None and found.pictures("g2", "color") is None


@pytest.mark.parametrize("spoil", [lambda data: b"", lambda data: data[:-40], lambda data: b"t_s,cap0_x_m\n"])
def test_what_is_no_recording_is_refused(tmp_path: Path, spoil) -> None:
    """Empty, cut off, a text."""
    path = tmp_path / "g1.npz"
    write_recording(path, streams())
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(InputError, match="cannot be read") as caught:
        read_recording(path)
    assert caught.value.where == str(path)


def test_arrays_that_say_nothing_of_themselves_are_refused(tmp_path: Path) -> None:
    """Somebody else's npz, and one that would run code."""
    np.savez(tmp_path / "a.npz", t=np.arange(3))
    np.savez(tmp_path / "b.npz", attributes=np.array([object()]))
    for name in ("a", "b"):
        with pytest.raises(InputError, match="cannot be read"):
            read_recording(tmp_path / f"{name}.npz")
