"""Which runs of an estimate a simulator has learned from, whatever `identify` called them; and which one is stale."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from r2s2r_cli.commands.compare import _show
from r2s2r_cli.commands.compare_models import learned_names, require_current
from r2s2r_cli.commands.wanted import robot_part
from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.views.compare_page import comparison_page
from schemas.header import Header, InputRef
from schemas.results_compare import CompareReport
from schemas.versions import STAGE_VERSIONS
from tests.commands.conftest import document
from tests.guards.listing import ROOT

SHA = "0" * 64


def model_of(project: Project) -> Path:
    """Where an identification lies, there or not."""
    return project.root / "iterations" / "001" / "30-identify.h5"


def header(project: Path, *estimates: str, **changed: object) -> Header:
    """That of an identification from these estimates, in the order in which `identify` read them."""
    found = read_header(project / "iterations" / "001" / "20-estimate.h5")
    refs = tuple(InputRef(path=path, kind="estimate", sha256=SHA) for path in estimates)
    named = {"stage": "identify", "stage_version": STAGE_VERSIONS["identify"], "inputs": refs, "robot": {}}
    made = found.provenance.model_copy(update={**named, **changed})
    return found.model_copy(update={"provenance": made})


@pytest.fixture
def looped(estimated: Path) -> Project:
    """The sample estimated in both iterations, recorded and executed."""
    source = estimated / "iterations" / "001" / "20-estimate.h5"
    for number in ("001", "002"):
        for name in ("20-estimate.h5", "51-estimate.h5"):
            path = estimated / "iterations" / number / name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(source.read_bytes())
    return Project.find(estimated)


@pytest.mark.parametrize(
    ("read", "wanted"),
    [
        (["001/20"], {"001/20": "sample"}),
        (["001/20", "001/51"], {"001/20": "sample", "001/51": "executed-sample"}),
        (["001/51"], {"001/51": "sample"}),
        (["002/51", "001/20", "001/51"],
         {"002/51": "sample", "001/20": "001-sample", "001/51": "executed-001-sample"}),
    ],
)  # fmt: skip
def test_runs_are_found_under_the_names_that_identify_gave_them(
    looped: Project, read: list[str], wanted: dict[str, str]
) -> None:
    """Those of other iterations carry its number, executed ones a word where the name is taken."""
    paths = [f"iterations/{name}-estimate.h5" for name in read]
    found = learned_names(looped, model_of(looped), header(looped.root, *paths))
    assert found == {(f"iterations/{key}-estimate.h5", "sample"): name for key, name in wanted.items()}


def test_an_estimate_that_is_gone_is_not_looked_into(looped: Project) -> None:
    """Its runs cannot be compared either."""
    found = learned_names(looped, model_of(looped), header(looped.root, "iterations/007/20-estimate.h5"))
    assert found == {}


def test_runs_of_another_project_are_not_those_at_the_same_place(looped: Project, tmp_path: Path) -> None:
    """A simulator from elsewhere has learned from what lies here only where that is the same, by its hash; one that was
    copied out of this project has."""
    elsewhere, name = tmp_path / "elsewhere" / "30-identify.h5", "iterations/001/20-estimate.h5"
    assert learned_names(looped, elsewhere, header(looped.root, name)) == {}
    same = read_header(looped.root / name).content_sha256
    ref = InputRef(path=name, kind="estimate", schema_version=1, sha256=same)
    found = learned_names(looped, elsewhere, header(looped.root, inputs=(ref,)))
    assert found == {(name, "sample"): "sample"}


def test_a_project_that_is_named_by_a_link_is_the_same_one(looped: Project, tmp_path: Path) -> None:
    """Its simulators are no other project's: they have learned from the runs here, and what changed since is said."""
    (tmp_path / "link").symlink_to(looped.root, target_is_directory=True)
    for project in (looped, Project.find(tmp_path / "link")):
        path, made = model_of(project), header(project.root, "iterations/001/20-estimate.h5")
        made = made.model_copy(
            update={"provenance": made.provenance.model_copy(update={"robot": robot_part("identify", project.robot())})}
        )
        assert learned_names(project, path, made) == {("iterations/001/20-estimate.h5", "sample"): "sample"}
        (said,) = require_current(project, "initial", path, made)
        assert "20-estimate.h5 changed" in said


def test_numbers_of_another_robot_or_version_are_refused(looped: Project) -> None:
    """Exit code 4, what differs, and the command that mends it."""
    from r2s2r_cli.commands.wanted import robot_part

    path = looped.root / "iterations" / "001" / "30-identify.h5"
    part = robot_part("identify", looped.robot())
    fresh = header(looped.root, robot=part)
    assert require_current(looped, "refined", path, fresh) == []
    other = {**part, "name": "sixbar"}
    with pytest.raises(InputError) as caught:
        require_current(looped, "refined", path, header(looped.root, robot=other))
    assert "refined is stale" in caught.value.what
    assert "name was 'sixbar', is 'threebar'" in str(caught.value.received)
    assert caught.value.hint == "r2s2r identify --iteration 1"
    with pytest.raises(InputError, match="stale") as caught:
        require_current(looped, "refined", path, header(looped.root, robot=part, stage_version=99))
    assert "version 99" in str(caught.value.received)


def test_changed_inputs_are_told_and_do_not_stop_it(looped: Project) -> None:
    """Another estimate since does not make it another simulator; of another project nothing can be said."""
    from r2s2r_cli.commands.wanted import robot_part

    part = robot_part("identify", looped.robot())
    one = header(looped.root, "iterations/001/20-estimate.h5", robot=part)
    (said,) = require_current(looped, "refined", looped.root / "iterations" / "001" / "30-identify.h5", one)
    assert "iterations/001/20-estimate.h5 changed" in said
    assert require_current(looped, "refined", looped.root.parent / "elsewhere.h5", one) == []


def test_what_a_simulator_is_stale_by_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    """On the page, which says nothing of inputs; the terminal has it of the file, whatever its words are. Warnings are
    on both."""
    path = ROOT / "examples" / "sample-project" / "project" / "iterations" / "002" / "60-compare.h5"
    found, data = read_artifact(path, "comparison")
    cause, other = "simulator a: input 20-estimate.h5 changed", "simulator b fell over"
    report = CompareReport.model_validate(found.provenance.report)
    report = report.model_copy(update={"stale": (cause,), "warnings": (other,)})
    _show(report, Console())
    said = capsys.readouterr().err
    assert other in said and cause not in said
    robot = Project.find(path.parents[2]).robot()
    page = comparison_page(report, data, robot, {}, {}, None).decode()
    assert cause in page and other in page


def test_a_file_of_two_names_is_one_input(tmp_path: Path) -> None:
    """What it is stale by is told once."""
    root = Path(shutil.copytree(ROOT / "examples" / "sample-project" / "project", tmp_path / "project"))
    first = root / "iterations" / "001"
    shutil.copy(first / "51-estimate.h5", first / "20-estimate.h5")  # what 30-identify.h5 was made of is another now
    models = [word for name in "ab" for word in ("--model", f"{name}={first / '30-identify.h5'}")]
    answer = document("compare", "--project", str(root), "--iteration", "1", *models, "--dry-run")
    assert answer["inputs"].count("iterations/001/30-identify.h5") == 1
    assert sum("30-identify.h5 is stale itself" in text for text in answer["stale_inputs"]) == 1
