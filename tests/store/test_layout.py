"""Every way in which a file can depart from its schema is named, with its place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from r2s2r_cli.store.hashing import ForeignContent
from r2s2r_cli.store.layout import Mismatch, check_layout
from schemas.versions import KINDS
from tests.store.conftest import Copy

Edit = Callable[[h5py.File], None]


def mismatches(path: Path, edit: Edit, kind: str) -> list[Mismatch]:
    """What the layout check finds after `edit`."""
    with h5py.File(path, "r+") as file:
        edit(file)
        return check_layout(file, KINDS[kind])


def replace(file: h5py.File, path: str, array: np.ndarray) -> None:
    """Another array under the name and the attributes of a dataset."""
    attributes = dict(file[path].attrs)
    del file[path]
    file[path] = array
    for name, value in attributes.items():
        file[path].attrs[name] = value


def with_dtype(file: h5py.File) -> None:
    """float32 where the schema says float64."""
    replace(file, "runs/walk/caps/t", file["runs/walk/caps/t"][()].astype("float32"))


def with_axis(file: h5py.File) -> None:
    """One axis too many."""
    replace(file, "runs/walk/caps/t", file["runs/walk/caps/t"][()][:, None])


def with_length(file: h5py.File) -> None:
    """One row less than the other datasets on the same axis."""
    replace(file, "runs/walk/caps/drop_reason", file["runs/walk/caps/drop_reason"][()][:-1])


def with_four_coordinates(file: h5py.File) -> None:
    """A fourth coordinate."""
    replace(file, "runs/walk/mocap/p_ME", np.zeros((24, 6, 4)))


def attribute(path: str, name: str, value: object) -> Edit:
    """An edit that sets one attribute."""

    def edit(file: h5py.File) -> None:
        file[path].attrs[name] = value

    return edit


def without(path: str, name: str = "") -> Edit:
    """An edit that removes a dataset, group or attribute."""

    def edit(file: h5py.File) -> None:
        if name:
            del file[path].attrs[name]
        else:
            del file[path]

    return edit


def added(path: str) -> Edit:
    """An edit that adds a dataset."""

    def edit(file: h5py.File) -> None:
        file[path] = np.zeros(3)

    return edit


RECORDING: list[tuple[Edit, str, str]] = [
    (with_dtype, "runs/walk/caps/t", "wrong dtype"),
    (with_axis, "runs/walk/caps/t", "wrong number of axes"),
    (with_length, "runs/walk/caps/drop_reason", "axis t_caps has another length"),
    (with_four_coordinates, "runs/walk/mocap/p_ME", "axis xyz has the wrong length"),
    (attribute("runs/walk/caps/p_WE", "unit", b"mm"), "runs/walk/caps/p_WE@unit", "wrong unit"),
    (attribute("runs/walk/caps/p_WE", "frame", b"C"), "runs/walk/caps/p_WE@frame", "wrong frame"),
    (attribute("runs/walk/caps/p_WE", "dims", b"cap,t_caps,xyz"), "runs/walk/caps/p_WE@dims", "wrong dims"),
    (without("runs/walk/caps/p_WE", "unit"), "runs/walk/caps/p_WE@unit", "wrong unit"),
    (attribute("runs/walk", "nature", b"guessed"), "runs/walk@nature", "unknown value"),
    (attribute("runs/walk", "robot", np.int64(3)), "runs/walk@robot", "wrong type"),
    (attribute("runs/walk", "pid_range", np.int64(1)), "runs/walk@pid_range", "wrong type"),
    (attribute("runs/walk", "mood", b"fine"), "runs/walk@mood", "no such attribute"),
    (without("runs/walk", "origin"), "runs/walk@origin", "required attribute is missing"),
    (without("runs/walk/caps/p_WE"), "runs/walk/caps/p_WE", "required dataset is missing"),
    (without("runs/walk/camera/color/offset"), "runs/walk/camera/color/offset", "required dataset is missing"),
    (without("runs"), "runs/{run}", "required group is missing"),
    (added("runs/walk/caps/x"), "runs/walk/caps/x", "no such dataset"),
    (added("runs/walk/extra/x"), "runs/walk/extra/x", "no such dataset"),
    (lambda file: file.create_group("notes"), "notes", "no such group"),
]  # fmt: skip


@pytest.mark.parametrize(("edit", "where", "what"), RECORDING, ids=[f"{w}-{x}" for _, w, x in RECORDING])
def test_every_departure_is_named(golden: Copy, edit: Edit, where: str, what: str) -> None:
    """One edit of a recording gives a mismatch at that place, with what is expected and what is there."""
    found = mismatches(golden("recording"), edit, "recording")
    hits = [m for m in found if m.where == where and what in m.what]
    assert hits and hits[0].expected and hits[0].received, found


@pytest.mark.parametrize("kind", KINDS)
def test_golden_artifacts_fit_their_layout(golden: Copy, kind: str) -> None:
    """What was written in this version has no mismatch."""
    assert mismatches(golden(kind), lambda file: None, kind) == []


def test_a_group_required_in_every_run_is_missed_in_the_second(golden: Copy) -> None:
    """A second run without its frames is a mismatch although the first run has them."""

    def second(file: h5py.File) -> None:
        file.copy("runs/walk", file["runs"], "again")
        del file["runs/again/frames"]

    found = mismatches(golden("estimate"), second, "estimate")
    assert [m.where for m in found] == ["runs/again/frames"]


def test_axes_of_runs_are_independent_and_of_groups_outside_runs_too(golden: Copy) -> None:
    """Two runs may have different numbers of frames; within one group of a calibration, lengths must agree."""

    def shorter(file: h5py.File) -> None:
        file.copy("runs/walk", file["runs"], "again")
        for name in ("t", "p_WE", "drop_reason", "source_row"):
            replace(file, f"runs/again/caps/{name}", file[f"runs/again/caps/{name}"][()][:7])

    assert mismatches(golden("recording"), shorter, "recording") == []
    found = mismatches(
        golden("calibration"), lambda f: replace(f, "tendons/k2", f["tendons/k2"][()][:1]), "calibration"
    )
    assert [(m.where, m.what) for m in found] == [("tendons/k2", "axis curve has another length than in tendons/name")]


@pytest.mark.parametrize(
    "edit",
    [
        lambda f: f.__setitem__("runs/walk/soft", h5py.SoftLink("/runs/walk/caps")),
        lambda f: f.__setitem__("runs/walk/outside", h5py.ExternalLink("/etc/passwd", "/")),
        lambda f: f.__setitem__("runs/walk/ring", f["runs"]),
        lambda f: f.__setitem__("runs/walk/twin", f["runs/walk/caps/t"]),
    ],
    ids=["soft link", "external link", "ring of hard links", "second name"],
)
def test_links_are_refused_and_end(golden: Copy, edit: Edit) -> None:
    """Links, also a ring that would never end, are named as something no artifact has."""
    with pytest.raises(ForeignContent):
        mismatches(golden("recording"), edit, "recording")
