"""The generated schemas: what they describe is what the program reads and writes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pydantic
import pytest

from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.store.header import read_header
from schemas.generate import FILES, HOME, derived, layout, results
from schemas.robot import Robot
from schemas.versions import KINDS
from tests.commands.conftest import invoke
from tests.guards.listing import ROOT
from tests.schemas.test_models import changed
from tests.support.make_golden import GOLDEN, golden_path

DOCUMENTS = {path: json.loads(text) for path, text in derived().items() if path.endswith(".json")}
SCHEMAS = {path: document for path, document in DOCUMENTS.items() if "/layout_" not in path}


def check(name: str, value: Any) -> None:
    """`value` is what the schema `json/<name>.json` describes."""
    jsonschema.Draft202012Validator(DOCUMENTS[f"json/{name}.json"]).validate(value)


@pytest.mark.parametrize("path", SCHEMAS)
def test_schemas_are_schemas(path: str) -> None:
    """Each is valid JSON Schema of the draft that it names."""
    jsonschema.Draft202012Validator.check_schema(SCHEMAS[path])
    assert SCHEMAS[path]["$schema"].endswith("2020-12/schema")


@pytest.mark.parametrize("kind", KINDS)
def test_heads_of_artifacts_fit_their_schema(kind: str) -> None:
    """A reader in another language can rely on it."""
    header = read_header(golden_path(kind, KINDS[kind].version))
    check("header", json.loads(header.model_dump_json()))
    with pytest.raises(jsonschema.ValidationError):
        check("header", {**json.loads(header.model_dump_json()), "kind": 3})


def test_robot_descriptions_fit_their_schema() -> None:
    """Every robot that `init` writes."""
    for robot in ("threebar", "threebar-330", "sixbar"):
        check("robot", tomllib.loads(robot_toml(robot)))
    with pytest.raises(jsonschema.ValidationError):
        check("robot", {**tomllib.loads(robot_toml("threebar")), "wheels": 4})


def test_bounds_of_the_schema_are_those_of_the_models() -> None:
    """A number far out on either side is refused by an editor that reads the schema as it is by r2s2r."""
    for place, far in (("rest_caps_m.0.0", 20.5), ("rods.0.parts.0.offset_m", 162.5), ("sensors.0.offset_f", 12.5)):
        for value in (far, -far):
            wrong = changed(tomllib.loads(robot_toml("threebar")), place, value)
            with pytest.raises(pydantic.ValidationError, match="at most"):
                Robot.model_validate(wrong)
            with pytest.raises(jsonschema.ValidationError) as caught:
                check("robot", wrong)
            assert caught.value.instance == value


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("inspect", ("inspect", "{golden}")),
        ("validate", ("validate", "{golden}")),
        ("migrate", ("migrate", "{golden}")),
        ("recover", ("recover", "{golden}")),
        ("error", ("inspect", "no-such-file.h5")),
        ("export", ("export", "{golden}", "--out", "{out}")),
    ],
)
def test_documents_of_commands_fit_their_schema(tmp_path: Path, name: str, arguments: tuple[str, ...]) -> None:
    """What --json prints is what its schema says."""
    path = tmp_path / "policies.h5"
    path.write_bytes(golden_path("policy", 1).read_bytes())
    filled = [text.format(golden=path, out=tmp_path / "out") for text in arguments]
    check(f"result_{name}", json.loads(invoke(*filled, "--json").stdout))


def test_every_result_model_has_its_schema() -> None:
    """None of the documents of --json is left out, and their names do not collide with those of files."""
    assert {"result_error", "result_status", "result_stage", "result_import_report"} <= set(results())
    assert not set(results()) & set(FILES)


@pytest.mark.parametrize("kind", KINDS)
def test_the_page_of_layouts_has_every_column(kind: str) -> None:
    """One row a dataset and attribute, under the heading of its group."""
    page = derived()["LAYOUT.md"]
    section = page.split(f"## {kind}, version {KINDS[kind].version}\n")[1].split("\n## ")[0]
    for group in KINDS[kind].groups:
        text = section.split(f"### `/{group.path}`\n")[1].split("\n### ")[0]
        names = [d.path for d in group.datasets] + [a.name for a in group.attributes]
        assert re.findall(r"^\| `([^`]+)` \|", text, flags=re.MULTILINE) == names


def test_tables_have_one_cell_a_column() -> None:
    """No text breaks a row of the page."""
    rows = [line for line in derived()["LAYOUT.md"].splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {8, 6}


def test_layout_documents_can_be_read_back() -> None:
    """The JSON of a layout holds everything that the specification does."""
    for kind, spec in KINDS.items():
        document = DOCUMENTS[f"json/layout_{kind}.json"]
        fixed = document.pop("axes_of_fixed_length")
        assert fixed and type(spec).model_validate(document) == spec
        assert layout(spec)["kind"] == kind


def test_check_notices_what_is_stale(tmp_path: Path) -> None:
    """`--check` leaves with 1 and names the file that is changed, missing or too many; without it all is written."""
    for name in ("schemas", "pyproject.toml"):
        subprocess.run(["cp", "-r", str(ROOT / name), str(tmp_path)], check=True)
    home = tmp_path / HOME.name

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "schemas.generate", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert run().returncode == 0 and run("--check").returncode == 0
    (home / "LAYOUT.md").write_text("old")
    (home / "json" / "robot.json").unlink()
    (home / "json" / "wheel.json").write_text("{}")
    done = run("--check")
    assert done.returncode == 1
    assert all(name in done.stdout for name in ("LAYOUT.md", "robot.json", "wheel.json"))
    assert run().returncode == 0 and run("--check").returncode == 0 and not (home / "json" / "wheel.json").exists()


def test_golden_folder_is_there() -> None:
    """The tests above look at golden files."""
    assert GOLDEN.is_dir()
