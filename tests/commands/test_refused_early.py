"""What the real command refuses a dry run refuses as well, and hints lead somewhere when they are pasted."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from r2s2r_cli.commands.parsing import usage_error
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.from_here import typed_here
from tests.commands.conftest import invoke

PLAN = ("plan", "--behaviour", "forward")


@pytest.mark.parametrize(
    ("words", "code", "what", "received"),
    [
        (("identify", "--self-test", "--method", "paper"), 2, "self-test plants", "--method paper"),
        ((*PLAN, "--set", "plan.step_s=0.003"), 4, "does not divide", "0.003 s"),
        ((*PLAN, "--to", "1e300,1,90"), 2, "no place to go to", "1e300,1,90"),
        ((*PLAN, "--to", "nan,1,90"), 2, "no place to go to", "nan,1,90"),
    ],
)
def test_a_dry_run_refuses_what_the_command_would(
    estimated: Path, words: tuple[str, ...], code: int, what: str, received: str
) -> None:
    """At once, with a hint that goes through."""
    result = invoke(*words, "--dry-run")
    assert result.exit_code == code and what in result.stderr
    assert f"received: {received}" in result.stderr
    hint = result.stderr.splitlines()[-1].removeprefix("hint: ")
    again = invoke(*shlex.split(hint)[1:])
    assert again.exit_code == 0, again.stderr


@pytest.mark.parametrize(
    ("words", "mended"),
    [
        (("--free", "motor_speed.*", "--free", "motor_speed"), "r2s2r identify --free motor_speed --dry-run"),
        (("--train", ""), "r2s2r identify --train sample --dry-run"),
    ],
)
def test_what_was_wrong_is_not_in_the_hint(estimated: Path, words: tuple[str, ...], mended: str) -> None:
    """A pattern whose matches clash, and a name that is none."""
    result = invoke("identify", *words, "--dry-run")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == f"hint: {mended}"


def test_the_option_that_was_typed_is_named(estimated: Path) -> None:
    """Not the setting that it stands for."""
    result = invoke("identify", "--starts", "-3")
    assert result.exit_code == 2 and "where: --starts" in result.stderr


def test_a_recording_that_will_never_be_there_is_not_asked_for(estimated: Path) -> None:
    """An iteration whose robot only executes its plan has nothing that `estimate` could read."""
    place = estimated / "iterations" / "001"
    for source, target in (("10-record.h5", "50-execute.h5"), ("20-estimate.h5", "51-estimate.h5")):
        (place / source).rename(place / target)
    result = invoke("compare", "--of", "record", "--dry-run")
    assert result.exit_code == 2 and "has no recorded runs" in result.stderr
    assert result.stderr.splitlines()[-1] == "hint: r2s2r compare --of execute --dry-run"


def test_a_file_that_may_not_be_read_is_no_wrong_usage() -> None:
    """As the parser says it of an argument: exit code 4, as from every command that opens the file itself."""

    class Refused(Exception):
        param, ctx = None, None
        message = "Path 'my runs/a.h5' is not readable."

        def format_message(self) -> str:
            return f"Invalid value for 'FILES...': {self.message}"

    error = usage_error(Refused(), ["inspect", "my runs/a.h5"])
    assert isinstance(error, ArtifactError) and error.exit_code == 4
    assert error.received == os.strerror(13) and error.where == "my runs/a.h5"
    assert error.hint.startswith("ls -la ")


def test_a_command_is_typed_where_its_reader_is(tmp_path: Path) -> None:
    """Files keep their place, and the project is named where it would not be found; remarks stay."""
    root, inside, beside = tmp_path / "my lab", tmp_path / "my lab" / "iterations" / "001", tmp_path / "else"
    inside.mkdir(parents=True)
    beside.mkdir()
    (inside / "10-record.h5").write_text("")
    recover, stage = "r2s2r recover iterations/001/10-record.h5", "r2s2r estimate --iteration 1   # then the rest"
    assert [typed_here(one, root, root) for one in (recover, stage, "")] == [recover, stage, ""]
    assert typed_here(recover, root, inside) == "r2s2r recover 10-record.h5"
    assert typed_here(stage, root, inside) == stage
    assert typed_here(recover, root, beside) == "r2s2r recover '../my lab/iterations/001/10-record.h5'"
    assert typed_here(stage, root, beside) == "r2s2r estimate --iteration 1 --project '../my lab'   # then the rest"
    assert typed_here("ls -la x", root, beside) == "ls -la x"
