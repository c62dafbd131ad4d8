"""200 and more malformed CSV, TOML and JSON inputs through the command line, as a user would give them."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from tests.commands.conftest import invoke
from tests.support.import_samples import SIDECAR, frame_json, sample_robot, small_csv
from tests.support.malformed import Malformed, json_cases, mutated, sidecar_cases
from tests.support.malformed_csv import csv_cases

REFUSED = (3, 4)


@cache
def robot_text() -> str:
    """robot.toml of that robot."""
    return tomlkit.dumps(sample_robot().model_dump(mode="json", exclude_none=True))


@pytest.fixture
def here(project: Path) -> Path:
    """A project of the robot that the malformed logs were made from, with a good log."""
    (project / "robot.toml").write_text(robot_text())
    (project / "log.csv").write_text(small_csv())
    (project / "log.toml").write_text(SIDECAR)
    return project


def put_json(here: Path, data: bytes) -> str:
    """A folder of the authors' recorder whose second frame is `data`."""
    folder = here / "log"
    (folder / "data").mkdir(parents=True)
    (folder / "data" / "0000.json").write_text(json.dumps(frame_json()))
    (folder / "data" / "0001.json").write_bytes(data)
    return "log"


def put_csv(here: Path, data: bytes) -> str:
    """The log itself."""
    (here / "log.csv").write_bytes(data)
    return "log.csv"


def put_sidecar(here: Path, data: bytes) -> str:
    """The sidecar of the good log."""
    (here / "log.toml").write_bytes(data)
    return "log.csv"


CASES = [
    pytest.param(put, case, id=f"{kind}-{case.name}")
    for kind, put, cases in (
        ("csv", put_csv, csv_cases()),
        ("sidecar", put_sidecar, sidecar_cases()),
        ("json", put_json, json_cases()),
    )
    for case in cases
    if not case.accepted
]


def check_refused(result: Any, here: Path) -> None:
    """Exit code 3 or 4, facts and one hint on stderr, no traceback, nothing written."""
    assert result.exit_code in REFUSED, result.stderr
    lines = result.stderr.splitlines()
    assert "Traceback" not in result.stderr
    assert any(line.startswith("error: ") for line in lines)
    assert any(line.startswith("  where: ") for line in lines)
    assert lines[-1].startswith("hint: ")
    assert result.stdout == ""
    assert not list(here.glob("iterations/*/*"))
    assert not list(here.rglob("*.partial"))


@pytest.mark.parametrize(("put", "case"), CASES)
def test_a_malformed_log_is_refused(here: Path, put: Any, case: Malformed) -> None:
    """`import` refuses every malformed input with place and hint, and leaves project and source as they were."""
    source = put(here, case.data)
    check_refused(invoke("import", source, "--no-draw"), here)


@pytest.mark.parametrize(("put", "case"), CASES[::30])
def test_a_dry_run_reads_the_log(here: Path, put: Any, case: Malformed) -> None:
    """What `import` refuses is not said to be written: the same words."""
    source = put(here, case.data)
    refused = invoke("import", source, "--no-draw", "--dry-run")
    check_refused(refused, here)
    assert refused.stderr == invoke("import", source, "--no-draw").stderr


def test_a_dry_run_of_a_log_without_a_sidecar_or_rows(here: Path) -> None:
    """Refused as the import is; the good log would be written, and is not."""
    before = sorted(here.rglob("*"))
    accepted = invoke("import", "log.csv", "--dry-run")
    assert accepted.exit_code == 0 and "would write iterations/001/10-record.h5" in accepted.stderr
    assert sorted(here.rglob("*")) == before
    (here / "log.toml").unlink()
    assert invoke("import", "log.csv", "--dry-run").exit_code == invoke("import", "log.csv").exit_code == 4
    (here / "log.toml").write_text(SIDECAR)
    (here / "log.csv").write_text("")
    assert invoke("import", "log.csv", "--dry-run").exit_code == 4


def test_the_good_log_is_accepted(here: Path) -> None:
    """What the malformed inputs were made from is imported: the refusals above are not for another reason."""
    assert invoke("import", "log.csv", "--no-draw").exit_code == 0


TOML_FILES = {
    "project.toml": ("status",),
    "robot.toml": ("status",),
    "policy.toml": ("validate", "policy.toml"),
    "masses.toml": ("calibrate", "--masses", "masses.toml"),
}
POLICY = """\
schema_version = 1
robot = "threebar"
name = "gait"
[[steps]]
target = [0, 1, 0, 1, 0, 1]
[[steps]]
target = [1, 1, 1, 1, 1, 1]
hold_s = 0.5
"""
MASSES = """\
[[part]]
name = "rod"
mass_kg = 0.04
offset_m = 0.0
shape = "cylinder"
radius_m = 0.0016
length_m = 0.3
"""
BROKEN: dict[str, bytes] = {
    "empty": b"",
    "binary": bytes(range(128, 256)),
    "utf16": POLICY.encode("utf-16"),
    "open_string": b'name = "x',
    "duplicate": b"schema_version = 1\nschema_version = 1\n",
    "list": b"[[[",
    "deep": b"a = " + b"[" * 3000,
    "unknown_key": b"colour = 1\n",
    "version": b"schema_version = 99\n",
    "nan": b"schema_version = nan\n",
}


@pytest.mark.parametrize("name", list(TOML_FILES))
@pytest.mark.parametrize("broken", list(BROKEN))
def test_a_broken_toml_file_is_refused(project: Path, name: str, broken: str) -> None:
    """Every TOML file that people write is refused where it is broken, by whatever command reads it."""
    (project / name).write_bytes(BROKEN[broken])
    result = invoke(*TOML_FILES[name])
    assert result.exit_code in REFUSED, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stderr.splitlines()[-1].startswith("hint: ")


@pytest.mark.parametrize("name", list(TOML_FILES))
def test_random_damage_to_toml_never_ends_in_a_traceback(project: Path, name: str) -> None:
    """40 randomly damaged versions of each TOML file are read, or refused with a hint; never anything else."""
    good = {"policy.toml": POLICY.encode(), "masses.toml": MASSES.encode()}
    original = good.get(name) or (project / name).read_bytes()
    refused = 0
    for seed in range(40):
        (project / name).write_bytes(mutated(original, seed))
        result = invoke(*TOML_FILES[name], *(("--no-draw", "--force") if name == "masses.toml" else ()))
        assert result.exit_code in (0, *REFUSED), (seed, result.stderr)
        if result.exit_code:
            refused += 1
            assert result.stderr.splitlines()[-1].startswith("hint: "), seed
    assert refused > 10
