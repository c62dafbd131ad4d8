"""A check that asks for an artifact to be made again shows the command line that makes this one again."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from r2s2r_cli.commands.mend import MOVES
from r2s2r_cli.store.write import write_artifact
from schemas.results import ValidateResult
from tests.commands.conftest import invoke
from tests.support import builders
from tests.support.forge import forge, put

RECORDING = Path("iterations/001/10-record.h5")
ESTIMATE = Path("iterations/001/20-estimate.h5")
GAIT = 'schema_version = 1\nrobot = "threebar"\nname = "gait"\n[[steps]]\ntarget = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]\n'
COMMAND = "r2s2r estimate --set estimate.sensor_gap_s=0.2 --iteration 1 --force"


def hints(*arguments: str) -> dict[str, str]:
    """What `validate` hints, by the name of the check."""
    result = invoke("validate", *arguments, "--json")
    return {one.check: one.hint for one in ValidateResult.model_validate(json.loads(result.stdout)).findings}


@pytest.fixture
def wrong(estimated: Path) -> Path:
    """The project, with states of a certain setting in which a deviation is negative."""
    assert invoke("estimate", "--set", "estimate.sensor_gap_s=0.2", "--no-draw").exit_code == 0
    forge(ESTIMATE, put("runs/sample/frames/quality", (3, 0), 7))
    forge(ESTIMATE, put("runs/sample/frames/p_WE", (3, 0, 0), float("nan")))
    return estimated


def test_states_are_made_again_as_they_were(wrong: Path) -> None:
    """With the options of then, and --force: nothing that they were made from has changed. Pasted, it mends them."""
    hint = hints(str(ESTIMATE))["values_finite"]
    assert hint == f"{COMMAND}   # first look at the named place in what it was made from"
    assert invoke(*shlex.split(hint, comments=True)[1:], "--no-draw").exit_code == 0
    assert "values_finite" not in hints(str(ESTIMATE))


@pytest.mark.parametrize(("folder", "way"), [("..", "robot"), ("iterations/001", "../..")])
def test_from_elsewhere_the_line_goes_there_first(
    wrong: Path, folder: str, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The paths in it are of the project's directory."""
    monkeypatch.chdir(wrong / folder)
    assert hints(str(wrong / ESTIMATE))["values_finite"].startswith(f"cd {way} && {COMMAND}   # ")


def test_from_elsewhere_status_is_of_the_project(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hint of an input that changed, pasted above the project, finds it."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 0.5))
    assert hints(str(ESTIMATE))["inputs_match"] == "r2s2r status"
    monkeypatch.chdir(estimated.parent)
    hint = hints(f"robot/{ESTIMATE}")["inputs_match"]
    assert hint == "r2s2r status --project robot"
    assert invoke(*shlex.split(hint)[1:]).exit_code == 0


@pytest.mark.parametrize("policy", [True, False])
def test_of_a_robot_its_runs_are_shown(estimated: Path, policy: bool) -> None:
    """Nothing that was measured has a source to be mended first, and no hint moves a robot; without the policies what
    was done is shown."""
    settings = {"flags": {"policies": ["gait.toml"]}}
    made = builders.provenance(stage="record", argv=("r2s2r", "record"), settings=settings)
    write_artifact(RECORDING, builders.recording(), made)
    if policy:
        Path("gait.toml").write_text(GAIT)
    forge(RECORDING, put("runs/walk/commands/target", (0, 0), 1.5))
    hint = hints(str(RECORDING))["targets_in_range"]
    if policy:
        assert hint == f"r2s2r record gait.toml --iteration 1 --force --dry-run   # {MOVES}"
        assert invoke(*shlex.split(hint, comments=True)[1:]).exit_code == 0
    else:
        assert hint.startswith(f"r2s2r inspect {RECORDING}   # how it was made: ")


def test_an_import_is_made_again_while_its_log_is_there(estimated: Path) -> None:
    """Without the log nothing makes it again: what it was made from is shown, and the reason said."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 1.5))
    remark = "first write targets in the source as positions 0 .. 1"
    assert hints(str(RECORDING))["targets_in_range"] == f"r2s2r import sample.csv --iteration 1 --force   # {remark}"
    Path("sample.csv").unlink()
    hint = hints(str(RECORDING))["targets_in_range"]
    assert (
        hint
        == f"r2s2r inspect {RECORDING}   # how it was made: it cannot be made again: sample.csv is not kept; {remark}"
    )
    assert invoke(*shlex.split(hint, comments=True)[1:]).exit_code == 0


def test_what_no_stage_writes_here_is_looked_at(wrong: Path) -> None:
    """A copy of states beside them: to make it again would write over the others."""
    copy = ESTIMATE.with_name("old.h5")
    ESTIMATE.rename(copy)
    assert hints(str(copy))["values_finite"].startswith(f"r2s2r inspect {copy}   # how it was made: no stage writes it")


def test_a_misnamed_artifact_goes_where_it_belongs(estimated: Path) -> None:
    """To the place of its kind where that is free; else aside, and `status` says what makes again what belongs here."""
    place = ESTIMATE.with_name("30-identify.h5")
    place.write_bytes(ESTIMATE.read_bytes())
    assert hints(str(place))["name_fits_kind"].startswith(f"mv -n {place} {place}.aside && r2s2r status   # ")
    ESTIMATE.unlink()
    assert hints(str(place))["name_fits_kind"] == f"mv -n {place} {ESTIMATE}"
    there = estimated / "elsewhere.toml"
    there.write_text("x = 1\n")
    assert hints(there.name)["file_opens"].startswith("r2s2r validate --help   # ")


def test_what_was_seldom_seen_is_drawn(estimated: Path) -> None:
    """A cap that was mostly guessed: the line draws the pictures in which to look for why."""
    forge(ESTIMATE, put("runs/sample/frames/quality", (slice(None), 2), 2))
    hint = hints(str(ESTIMATE))["caps_well_observed"]
    assert hint.startswith("r2s2r estimate --iteration 1 --force   # draws the pictures beside it: look there at")
    assert invoke(*shlex.split(hint, comments=True)[1:]).exit_code == 0
    assert ESTIMATE.with_name("20-estimate-sample.png").is_file()


def test_noise_that_a_log_does_not_state(estimated: Path) -> None:
    """It is stated beside the log, and `status` then says what follows."""
    forge(ESTIMATE, put("runs/sample/tracks/innovation_variance", (0,), 9.0))
    hint = hints(str(ESTIMATE))["noise_as_assumed"]
    assert hint.startswith("r2s2r status   # once the sidecar of the log states noise_sd_m")
    sidecar = Path("sample.toml")
    sidecar.write_text(sidecar.read_text().replace("noise_sd_m = 0.002", "noise_sd_m = 0.004"))
    assert invoke(*shlex.split(hint, comments=True)[1:]).stderr.splitlines()[-1] == (
        "hint: r2s2r import sample.csv --iteration 1"
    )
