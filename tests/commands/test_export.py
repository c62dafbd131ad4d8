"""`r2s2r export`: what other programs read is what the artifact holds."""

from __future__ import annotations

import csv
import json
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.stages.export.tables import column_names, csv_names
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.write import write_artifact
from schemas.base import Unit, column
from schemas.policy import PolicyFile
from schemas.versions import KINDS
from tests.commands.conftest import document, invoke

RECORD = "iterations/001/10-record.h5"
ESTIMATE = "iterations/001/20-estimate.h5"


def test_csv_holds_every_number_exactly(estimated: Path) -> None:
    """The table of frames has a column for every coordinate, with its unit, and loses no digit."""
    document("export", ESTIMATE, "--to", "csv", "--out", "out")
    with Path("out/20-estimate/runs/sample/frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    _, data = read_artifact(estimated / ESTIMATE)
    frames = data.groups["runs/sample/frames"]
    for axis, name in enumerate("xyz"):
        column = np.array([float(row[f"p_WE_cap3_{name}_m"]) for row in rows])
        np.testing.assert_array_equal(column, frames["p_WE"][:, 3, axis])
    np.testing.assert_array_equal([float(row["t_s"]) for row in rows], frames["t"])
    assert {int(row["contact_cap2"]) for row in rows} <= {0, 1}


def test_tables_are_named_after_their_group_and_columns_after_their_values(estimated: Path) -> None:
    """One table a group, a second one where rows differ; quaternions are x, y, z, w; no slash in any column."""
    document("export", RECORD, "--out", "out")
    document("export", ESTIMATE, "--out", "out")
    found = {path.relative_to("out").as_posix(): path for path in Path("out").rglob("*.csv")}
    run = "10-record/runs/sample"
    assert {f"{run}/caps.csv", f"{run}/caps_by_cap.csv", f"{run}/caps_by_rod.csv", f"{run}/sensors.csv"} <= set(found)
    assert "20-estimate/runs/sample/ground.csv" in found
    with found["20-estimate/runs/sample/ground.csv"].open() as file:
        (ground,) = csv.DictReader(file)
    assert [float(ground[f"normal_{axis}"]) for axis in "xyz"] == [0.0, 0.0, 1.0]
    with found["20-estimate/runs/sample/frames.csv"].open() as file:
        first = next(csv.DictReader(file))
    assert sum(float(first[f"q_WR_rod1_{part}"]) ** 2 for part in "xyzw") == pytest.approx(1.0)
    headers = [path.read_text().splitlines()[0] for path in found.values()]
    assert headers
    assert not any(set("/^ ") & set(header) for header in headers)


@pytest.mark.parametrize(
    ("unit", "dims", "shape", "names"),
    [
        ("F/m", ("set", "sensor"), (3, 2), ["a_sensor0_f_per_m", "a_sensor1_f_per_m"]),
        ("1", ("t_pose", "quat"), (9, 4), ["a_x", "a_y", "a_z", "a_w"]),
        ("m^2", ("frame", "cap", "xyz", "xyz2"), (9, 1, 3, 3), [f"a_cap0_{i}_{j}_m2" for i in "xyz" for j in "xyz"]),
        ("1", ("mat4", "mat4"), (4, 4), [f"a_{i}_{j}" for i in range(4) for j in range(4)]),
        ("unix s", ("entry",), (5,), ["a_unix_s"]),
    ],
)
def test_column_names(unit: Unit, dims: tuple[str, ...], shape: tuple[int, ...], names: list[str]) -> None:
    """A column says which component it is, and its unit in words that any program takes as a name."""
    assert column_names(column("a", "float64", dims, unit, "what it is"), shape) == names


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


def test_lengths_keep_their_cables(project: Path) -> None:
    """Lengths of some cables only, and a row that runs backwards: each column comes back under its own cable."""
    with Path("sample.csv").open() as file:
        table = list(csv.reader(file))
    kept = [i for i, name in enumerate(table[0]) if not name.startswith("length") or name in ("length3_m", "length7_m")]
    rows = [[row[i] for i in kept] for row in table]
    rows[50], rows[51] = rows[51], rows[50]
    with Path("some.csv").open("w") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    Path("some.toml").write_text(Path("sample.toml").read_text())
    assert invoke("import", "some.csv", "--no-draw").exit_code == 0
    document("export", RECORD, "--to", "trajectory", "--out", "again")
    with Path("again/some.csv").open() as file:
        again = list(csv.DictReader(file))
    assert sorted(name for name in again[0] if name.startswith("length")) == ["length3_m", "length7_m"]
    assert invoke("import", "again/some.csv", "--iteration", "2", "--no-draw").exit_code == 0
    _, before = read_artifact(project / RECORD)
    _, after = read_artifact(project / "iterations/002/10-record.h5")
    for name in ("t", "length", "cable"):
        np.testing.assert_array_equal(before.groups["runs/some/sensors"][name], after.groups["runs/some/sensors"][name])


def test_a_policy_holds_the_targets_in_order(estimated: Path) -> None:
    """The targets of a run become a policy file that validates."""
    (name,) = document("export", RECORD, "--to", "policy")["files"]
    policy = PolicyFile.model_validate(tomllib.loads(Path(name).read_text()))
    _, data = read_artifact(estimated / RECORD)
    targets = data.groups["runs/sample/intervals"]["target"]
    np.testing.assert_array_equal([step.target for step in policy.steps], targets)
    assert invoke("validate", name).exit_code == 0


def test_a_run_without_a_target_is_no_policy(estimated: Path) -> None:
    """A policy needs a step: a file without one would be refused wherever it is read, so none is written."""
    header, data = read_artifact(Path(RECORD))
    intervals = {name: value[:0] for name, value in data.groups["runs/sample/intervals"].datasets.items()}  # type: ignore[index]
    groups = {**data.groups, "runs/sample/intervals": Group(intervals)}
    write_artifact(Path("bare.h5"), ArtifactData("recording", groups), header.provenance)
    refused = invoke("export", "bare.h5", "--to", "policy", "--out", "out")
    assert refused.exit_code == 4 and "expected: one target interval at least" in refused.stderr
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("first", "ending"),
    [
        (b"\xff\xd8\xff\xfe", "jpg"),
        (b"\xff\xd8\xff\xe2", "jpg"),
        (b"\xff\xd8\xff\xe0", "jpg"),
        (b"\x89PNG", "png"),
        (b"GIF8", "bin"),
    ],
)
def test_images_are_named_by_what_they_are(first: bytes, ending: str) -> None:
    """Every JPEG that `import` takes, whoever wrote it: with a comment or a colour profile first as well."""
    camera = Group({"color": Blobs([first + b"rest"], 1)})
    names = csv_names(ArtifactData("recording", {"runs/walk/camera": camera}), KINDS["recording"], "10-record")
    assert names[0] == f"10-record/runs/walk/camera/color/000000.{ending}"


def test_nothing_is_overwritten(estimated: Path) -> None:
    """A file in the way stays, unless --force."""
    Path("20-estimate.npz").write_text("mine")
    assert invoke("export", ESTIMATE, "--to", "npz").exit_code == 2
    assert Path("20-estimate.npz").read_text() == "mine"
    assert invoke("export", ESTIMATE, "--to", "npz", "--force").exit_code == 0


@pytest.mark.parametrize(
    ("source", "to", "last"),
    [
        (RECORD, "trajectory", "out/sample.toml"),
        (RECORD, "csv", "out/10-record/attributes.json"),
        (ESTIMATE, "npz", "out/20-estimate.npz"),
        ("robot.toml", "mjcf", "out/threebar.xml"),
    ],
)
def test_nothing_is_written_where_the_last_file_is_in_the_way(estimated: Path, source: str, to: str, last: str) -> None:
    """A new log beside somebody's old sidecar would be another run; the hint, pasted, writes all into a new place."""
    Path(last).parent.mkdir(parents=True)
    Path(last).write_text("mine")
    Path("out-2").mkdir()
    refused = invoke("export", source, "--to", to, "--out", "out")
    assert refused.exit_code == 2 and f"where: {last}" in refused.stderr
    assert [path for path in Path("out").rglob("*") if path.is_file()] == [Path(last)]
    mended = shlex.split(refused.stderr.splitlines()[-1], comments=True)[2:]
    assert mended == ["export", source, "--to", to, "--out", "out-3"]
    assert invoke(*mended).exit_code == 0 and Path(last.replace("out", "out-3", 1)).is_file()
    assert invoke("export", source, "--to", to, "--out", "out", "--force").exit_code == 0
    assert Path(last).read_bytes() == Path(last.replace("out", "out-3", 1)).read_bytes()


def test_a_directory_is_not_overwritten_half_way(estimated: Path) -> None:
    """One that has the name of a file stops --force too, before anything is written."""
    Path("sample.toml").unlink()
    Path("sample.toml").mkdir()
    before = Path("sample.csv").read_bytes()
    refused = invoke("export", RECORD, "--to", "trajectory", "--force")
    assert refused.exit_code == 2 and "received: a directory" in refused.stderr
    assert Path("sample.csv").read_bytes() == before
    assert "--out exported   #" in refused.stderr


def test_a_run_without_commands_is_exported_as_tables_instead(estimated: Path) -> None:
    """The hint names the artifact, and what it says works."""
    header, data = read_artifact(Path(RECORD))
    kept = {path: group for path, group in data.groups.items() if not path.endswith(("/commands", "/intervals"))}
    write_artifact(Path("a b.h5"), ArtifactData("recording", kept), header.provenance)
    for to in ("trajectory", "policy"):
        refused = invoke("export", "a b.h5", "--to", to, "--run", "sample")
        assert refused.exit_code == 4 and "where: a b.h5, run sample" in refused.stderr
        mended = shlex.split(refused.stderr.splitlines()[-1])[2:]
        assert mended == ["export", "a b.h5", "--to", "csv"]
    assert invoke(*mended).exit_code == 0


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
