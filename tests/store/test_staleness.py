"""Why something is stale, in words; and that nothing is after a comment."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from r2s2r_cli.commands.wanted import wanted
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.provenance import config_sha256
from r2s2r_cli.store.staleness import Wanted, artifact_ref, differences, reasons, source_ref
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, MigrationNote
from tests.support.builders import estimate, provenance, recording

SETTINGS = 'schema_version = 1\nname = "t"\n\n[estimate]\n{}\n'


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A project with a source, a recording made of it, and an estimate made of that."""
    (tmp_path / "project.toml").write_text(SETTINGS.format(""))
    (tmp_path / "robot.toml").write_text(robot_toml("threebar"))
    (tmp_path / "walk.csv").write_text("t_s\n0\n")
    here = Project.find(tmp_path)
    record(here)
    return here


def record(here: Project, frames: int = 24) -> Header:
    """Write the recording."""
    path = here.artifact("recording", here.iteration(1, create=True))
    return write_artifact(path, recording(frames), provenance(inputs=(source_ref(here, here.root / "walk.csv"),)))


def estimated(here: Project) -> Header:
    """Write the estimate as its stage would, from the recording that is there."""
    source = here.artifact("recording", here.iteration(1))
    now = want(here)
    made = provenance(
        stage="estimate",
        settings=now.settings,
        robot=now.robot,
        inputs=(artifact_ref(here, source, read_header(source)),),
    )
    return write_artifact(here.artifact("estimate", here.iteration(1)), estimate(), made)


def want(here: Project) -> Wanted:
    """What `estimate` would use now."""
    again = Project.find(here.root)
    return wanted(again, again.iteration(1), "estimate", {}, {})


def why(here: Project, header: Header) -> list[str]:
    """The reasons why the estimate is stale."""
    return reasons(Project.find(here.root), header, want(here))


def test_fresh_at_first(project: Project) -> None:
    """What was just made is fresh."""
    assert why(project, estimated(project)) == []


def test_comments_spaces_and_order_of_keys_change_nothing(project: Project) -> None:
    """Only values count: both TOML files may be rewritten in another order, with comments, and touched."""
    header = estimated(project)
    text = (project.root / "robot.toml").read_text()
    (project.root / "robot.toml").write_text("# a remark\n\n" + text.replace(" = ", "   =  ") + "\n# the end\n")
    (project.root / "project.toml").write_text("# mine\nname = 't'   # changed quotes\nschema_version = 1\n")
    os.utime(project.root / "robot.toml", (0, 0))
    assert why(project, header) == []


def test_a_setting_is_named_with_both_values(project: Project) -> None:
    """A changed setting gives one reason, with the old and the new value."""
    header = estimated(project)
    (project.root / "project.toml").write_text(SETTINGS.format("sensor_gap_s = 0.5"))
    assert why(project, header) == ["setting estimate.sensor_gap_s was 0.25, is 0.5"]


def test_the_default_written_out_is_no_change(project: Project) -> None:
    """Writing down the value that holds anyway makes nothing stale."""
    header = estimated(project)
    (project.root / "project.toml").write_text(SETTINGS.format("sensor_gap_s = 0.25"))
    assert why(project, header) == []


def test_a_value_of_the_robot_is_named_by_its_place(project: Project) -> None:
    """A number that the stage uses gives one reason with its path in robot.toml."""
    header = estimated(project)
    text = (project.root / "robot.toml").read_text()
    old = want(project).robot["rods"][0]["cap_radius_m"]
    assert text.count(f"cap_radius_m = {old}") == 3
    (project.root / "robot.toml").write_text(text.replace(f"cap_radius_m = {old}", "cap_radius_m = 0.02", 1))
    assert why(project, header) == [f"robot.toml: rods.0.cap_radius_m was {old}, is 0.02"]


def test_a_value_that_the_stage_does_not_use_changes_nothing(project: Project) -> None:
    """The friction prior is no business of `estimate`."""
    header = estimated(project)
    text = (project.root / "robot.toml").read_text()
    friction = want(project).robot.get("contact")
    assert friction is None and "friction = " in text
    lines = ["friction = 0.123" if line.startswith("friction = ") else line for line in text.splitlines()]
    (project.root / "robot.toml").write_text("\n".join(lines))
    assert why(project, header) == []


def test_a_new_stage_version_is_a_reason(project: Project) -> None:
    """What an older version of the stage computed is stale."""
    header, now = estimated(project), want(project)
    newer = Wanted(now.stage_version + 1, now.settings, now.robot)
    said = f"made by version {now.stage_version}, now {now.stage_version + 1}"
    assert reasons(project, header, newer) == [f"stage estimate changed: {said}"]


def test_an_input_that_changed_is_named(project: Project) -> None:
    """Another recording under the same name makes its estimate stale."""
    header = estimated(project)
    record(project, frames=20)
    assert why(project, header) == ["input iterations/001/10-record.h5 changed: its content hash is another"]


def test_an_input_made_again_with_the_same_content_changes_nothing(project: Project) -> None:
    """Times do not count."""
    header = estimated(project)
    record(project)
    assert why(project, header) == []


def test_an_input_that_is_gone_is_named(project: Project) -> None:
    """A missing artifact is a reason; so is a damaged one."""
    header = estimated(project)
    path = project.artifact("recording", project.iteration(1))
    content = path.read_bytes()
    path.unlink()
    assert why(project, header) == ["input iterations/001/10-record.h5: there is no such file"]
    path.write_bytes(content[:300] + b"?" + content[301:])
    assert why(project, header) == ["input iterations/001/10-record.h5: the head of this artifact is damaged"]


def test_an_input_that_was_migrated_is_the_same_input(project: Project) -> None:
    """`migrate` changes the form of an artifact: what was computed from it stays fresh."""
    header = estimated(project)
    path = project.artifact("recording", project.iteration(1))
    note = MigrationNote(from_version=1, to_version=2, content_sha256=read_header(path).content_sha256)
    write_artifact(path, recording(20), provenance(migrations=(note,)))  # another hash, and a note of the old one
    assert why(project, header) == []


def test_a_source_counts_by_its_bytes_and_may_be_gone(project: Project) -> None:
    """A changed log makes the recording stale, a touched one does not; the log may be deleted after the import."""
    header = read_header(project.artifact("recording", project.iteration(1)))
    now = Wanted(header.provenance.stage_version, header.provenance.settings, header.provenance.robot)
    source = project.root / "walk.csv"
    os.utime(source, (0, 0))
    assert reasons(project, header, now) == []
    source.write_text("t_s\n1\n")
    assert reasons(project, header, now) == ["input walk.csv changed: its bytes are others"]
    source.unlink()
    assert reasons(project, header, now) == []


def test_all_reasons_are_given_at_once(project: Project) -> None:
    """Setting, robot and input together give three reasons."""
    header = estimated(project)
    (project.root / "project.toml").write_text(SETTINGS.format("sensor_gap_s = 0.5"))
    text = (project.root / "robot.toml").read_text()
    (project.root / "robot.toml").write_text(text.replace("\ncap_radius_m = ", "\ncap_radius_m = 0.02 # was ", 1))
    record(project, frames=20)
    found = why(project, header)
    assert [reason.split(":")[0].split(" was")[0] for reason in found] == [
        "setting estimate.sensor_gap_s", "robot.toml", "input iterations/001/10-record.h5 changed"
    ]  # fmt: skip


def test_a_file_name_that_is_no_text_is_an_input_error(project: Project) -> None:
    """Such a name cannot be recorded: the user is asked to rename the file."""
    path = project.root / os.fsdecode(b"\xff.csv")
    path.write_text("x")
    with pytest.raises(InputError, match="UTF-8"):
        source_ref(project, path)


TREES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 3) | st.text(max_size=2),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=8,
)
MAPPINGS = st.dictionaries(st.sampled_from("abc"), TREES, max_size=3)


def _without_none(value: Any) -> Any:
    """Absent, None and an empty list are one; lists and tuples are one."""
    if isinstance(value, list):
        value = {str(i): item for i, item in enumerate(value)}
    if not isinstance(value, dict):
        return value
    return {k: _without_none(v) for k, v in value.items() if v is not None and v != []}


def test_a_list_that_is_newer_than_the_artifact_and_empty_does_not_make_it_stale() -> None:
    """With an entry it does; a table or a number that is new does."""
    assert differences({"free": ["friction"]}, {"free": ["friction"], "fix": []}) == []
    assert differences({}, {"fix": ["friction=1"]}) == ["fix was absent, is 'friction=1'"]
    assert differences({}, {"fix": ["a", "b", "c", "d"]}) == ["fix was absent, is a list of 4"]
    assert differences({"parts": [{"kg": 1.0}]}, {"parts": []}) == ["parts was a list of 1, is absent"]
    assert differences({}, {"fix": {}}) and differences({}, {"fix": 0})


@given(MAPPINGS, MAPPINGS)
def test_no_difference_means_equal(one: dict[str, Any], two: dict[str, Any]) -> None:
    """Two settings without a difference are equal up to absent keys, and their digests follow that rule."""
    assert differences(one, one) == []
    if differences(one, two):
        assert config_sha256(one, {}) != config_sha256(two, {})
    else:
        assert _without_none(one) == _without_none(two) or one == two
