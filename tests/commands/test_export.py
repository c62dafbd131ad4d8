"""`r2s2r export`: what other programs read is what the artifact holds."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.store.read import read_artifact
from schemas.policy import PolicyFile
from tests.commands.conftest import document, invoke

RECORD = "iterations/001/10-record.h5"
ESTIMATE = "iterations/001/20-estimate.h5"


def test_csv_holds_every_number_exactly(estimated: Path) -> None:
    """The table of frames has a column for every coordinate, with its unit, and loses no digit."""
    document("export", ESTIMATE, "--to", "csv", "--out", "out")
    with Path("out/20-estimate/runs/sample/frames/frame.csv").open() as file:
        rows = list(csv.DictReader(file))
    _, data = read_artifact(estimated / ESTIMATE)
    frames = data.groups["runs/sample/frames"]
    for axis, name in enumerate("xyz"):
        column = np.array([float(row[f"p_WE_cap3_{name}_m"]) for row in rows])
        np.testing.assert_array_equal(column, frames["p_WE"][:, 3, axis])
    np.testing.assert_array_equal([float(row["t_s"]) for row in rows], frames["t"])
    assert {int(row["contact_cap2"]) for row in rows} <= {0, 1}


def test_csv_carries_the_attributes(estimated: Path) -> None:
    """Scalars of the groups come as one JSON beside the tables."""
    document("export", RECORD, "--out", "out")
    attributes = json.loads(Path("out/10-record/attributes.json").read_text())
    assert attributes["runs/sample"]["nature"] == "kinematic sample"


def test_npz_holds_every_array(estimated: Path) -> None:
    """npz has each array under its path, without pickles, and the header as JSON."""
    document("export", ESTIMATE, "--to", "npz")
    _, data = read_artifact(estimated / ESTIMATE)
    with np.load("20-estimate.npz", allow_pickle=False) as arrays:
        assert json.loads(str(arrays["header"]))["kind"] == "estimate"
        for path, group in data.groups.items():
            for name, value in group.datasets.items():
                np.testing.assert_array_equal(arrays[f"{path}/{name}"], value)


def test_a_trajectory_comes_back_as_it_was(estimated: Path) -> None:
    """Export as a trajectory log, import that: the same numbers in every stream."""
    document("export", RECORD, "--to", "trajectory", "--out", "again")
    assert invoke("import", "again/sample.csv", "--iteration", "2", "--no-draw").exit_code == 0
    _, before = read_artifact(estimated / RECORD)
    _, after = read_artifact(estimated / "iterations/002/10-record.h5")
    for stream in ("caps", "commands", "sensors"):
        one, two = before.groups[f"runs/sample/{stream}"], after.groups[f"runs/sample/{stream}"]
        assert set(one.datasets) == set(two.datasets)
        for name in one.datasets:
            np.testing.assert_array_equal(one[name], two[name])
    assert before.groups["runs/sample"].attributes == after.groups["runs/sample"].attributes


def test_a_policy_holds_the_targets_in_order(estimated: Path) -> None:
    """The targets of a run become a policy file that validates."""
    (name,) = document("export", RECORD, "--to", "policy")["files"]
    policy = PolicyFile.model_validate(tomllib.loads(Path(name).read_text()))
    _, data = read_artifact(estimated / RECORD)
    targets = data.groups["runs/sample/intervals"]["target"]
    np.testing.assert_array_equal([step.target for step in policy.steps], targets)
    assert invoke("validate", name).exit_code == 0


def test_nothing_is_overwritten(estimated: Path) -> None:
    """A file in the way stays, unless --force."""
    Path("20-estimate.npz").write_text("mine")
    assert invoke("export", ESTIMATE, "--to", "npz").exit_code == 2
    assert Path("20-estimate.npz").read_text() == "mine"
    assert invoke("export", ESTIMATE, "--to", "npz", "--force").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("absent.h5",), 4),
        (("project.toml",), 4),
        ((".",), 4),
        ((ESTIMATE, "--to", "trajectory"), 4),
        ((RECORD, "--to", "policy", "--run", "nobody"), 2),
    ],
)
def test_what_cannot_be_exported_is_refused(estimated: Path, arguments: tuple[str, ...], code: int) -> None:
    """A missing file, a file of another form, an unknown run: refused with a hint."""
    result = invoke("export", *arguments)
    assert result.exit_code == code
    assert result.stderr.splitlines()[-1].startswith("hint: ")
