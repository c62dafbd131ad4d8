"""The frame of the command line: exit codes, where words go, hints, overrides."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from r2s2r_cli import errors
from r2s2r_cli.app import BUG_MESSAGE, app, run_guarded
from r2s2r_cli.errors import ExitCode, R2S2RError, UsageError
from r2s2r_cli.options import parse_overrides

FAMILY = [
    (errors.UsageError, 2),
    (errors.GateError, 3),
    (errors.InputError, 4),
    (errors.ArtifactError, 4),
    (errors.HardwareError, 5),
    (errors.NumericalError, 6),
]


def raising(error: BaseException) -> object:
    """A call that raises."""

    def call() -> None:
        raise error

    return call


@pytest.mark.parametrize(("kind", "code"), FAMILY)
def test_every_error_has_its_exit_code(kind: type[R2S2RError], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Each member of the error family leaves with the documented code, its facts and one hint on stderr."""
    error = kind("it broke", where="here", expected="this", received="that", hint="r2s2r status")
    assert run_guarded(raising(error), False) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "error: it broke", "  where: here", "  expected: this", "  received: that", "hint: r2s2r status",
    ]  # fmt: skip


def test_an_interrupt_leaves_with_130(capsys: pytest.CaptureFixture[str]) -> None:
    """Ctrl-C is not an error with a traceback."""
    assert run_guarded(raising(KeyboardInterrupt()), False) == ExitCode.INTERRUPTED
    assert "Traceback" not in capsys.readouterr().err


def test_a_bug_shows_its_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    """Only an unexpected exception gives a traceback, and it says that it is our fault."""
    assert run_guarded(raising(ZeroDivisionError()), False) == ExitCode.BUG
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert BUG_MESSAGE in err


def test_an_error_is_a_document_with_json(capsys: pytest.CaptureFixture[str]) -> None:
    """With --json a failure is one JSON document on stdout, so that a script need not read prose."""
    run_guarded(raising(UsageError("it broke", where="--set", hint="r2s2r --help")), True)
    document = json.loads(capsys.readouterr().out)
    assert (document["schema"], document["exit_code"], document["where"]) == ("r2s2r.error/1", 2, "--set")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["statsu"], "status"),
        (["status", "--jsno"], "--json"),
        (["export"], "path"),
        (["export", "x.h5", "--to", "xlsx"], "csv"),
        (["init", "--seed", "many"], "--seed"),
        (["bench"], "engine"),
    ],
)
def test_misspelt_usage_names_the_cure(arguments: list[str], words: str) -> None:
    """Unknown commands, options and values leave with 2, name what is near and what was received, and end with one
    hint line."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == ExitCode.USAGE
    assert words in result.stderr
    assert [line.split(":")[0].strip() for line in result.stderr.splitlines()] == [
        "error", "where", "expected", "received", "hint",
    ]  # fmt: skip
    assert result.stderr.splitlines()[-1].startswith("hint: r2s2r")
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("typed", "received", "hint"),
    [
        ("statsu --quiet", "statsu", "r2s2r status --quiet"),
        ("bench engin", "engin", "r2s2r bench engine"),
        ("nonsense --quiet", "nonsense", "r2s2r --help"),
        ("status --projct 'a b' --quiet", "--projct", "r2s2r status --project 'a b' --quiet"),
        ("status --projct=x", "--projct", "r2s2r status --project=x"),
        ("diagnose --frobnicate", "--frobnicate", "r2s2r diagnose --help"),
        ("diagnose --iteration abc --seed 4", "abc", "r2s2r diagnose --seed 4"),
        ("diagnose --also 1 --also x", "x", "r2s2r diagnose --also 1"),
        ("init a --seed=x", "x", "r2s2r init a --seed=0"),
        ("export x.h5 --to mjfc", "mjfc", "r2s2r export x.h5 --to mjcf"),
        ("export x.h5 --to xml", "xml", "r2s2r export --help"),
        ("import a.csv --format tum", "tum", "r2s2r import a.csv --format tum_rgbd"),
        ("status a b --quiet", "a b", "r2s2r status --quiet"),
        ("init a --seed", "nothing", "r2s2r init a"),
        ("status --json=1 --quiet", "1", "r2s2r status --json --quiet"),
        ("export", "nothing", "r2s2r export --help"),
        ("bench", "nothing", "r2s2r bench --help"),
    ],
)
def test_the_hint_is_the_command_line_without_the_slip(typed: str, received: str, hint: str) -> None:
    """What is near takes the place of what was wrong, and the other words stay; where nothing is near, the help."""
    result = CliRunner().invoke(app, shlex.split(typed))
    assert result.exit_code == ExitCode.USAGE
    assert result.stderr.splitlines()[-2:] == [f"  received: {received}", f"hint: {hint}"]


@pytest.mark.parametrize("command", ["inspect nosuch.h5", "validate far/away/nosuch.h5", "import nosuch.csv"])
def test_a_file_that_is_not_there_is_said_whole(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was expected and that there is nothing; the hint lists a folder that is there."""
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["init", "."]).exit_code == 0
    result = CliRunner().invoke(app, command.split())
    lines = result.stderr.splitlines()
    assert result.exit_code == ExitCode.INPUT and lines[-3].startswith("  expected: ")
    assert lines[-2] == "  received: nothing"
    assert lines[-1] in ("hint: ls .", "hint: ls -la .")


@pytest.mark.parametrize("name", ["--help", "--version"])
def test_help_and_version_go_to_stdout(name: str) -> None:
    """What was asked for is data."""
    result = CliRunner().invoke(app, [name])
    assert result.exit_code == 0
    assert "r2s2r" in result.stdout
    assert result.stderr == ""


def test_no_project_is_said_with_a_hint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside a project a command says so and how to make one."""
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["status"])
    assert result.exit_code == ExitCode.INPUT
    assert result.stderr.splitlines()[-1].startswith("hint: r2s2r init")


def test_a_closed_pipe_is_not_an_error(tmp_path: Path) -> None:
    """`r2s2r ... | head -1` ends quietly."""
    command = f"'{sys.executable}' -m r2s2r_cli doctor --quick | head -1"
    shell = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, cwd=tmp_path)
    assert shell.returncode == 0
    assert "Traceback" not in shell.stderr
    assert "Exception ignored" not in shell.stderr


def test_no_escape_codes_when_piped(tmp_path: Path) -> None:
    """Piped output is plain text, whatever the terminal."""
    environment = {**os.environ, "TERM": "xterm-256color"}
    child = subprocess.run(
        [sys.executable, "-m", "r2s2r_cli", "doctor", "--quick"], capture_output=True, cwd=tmp_path, env=environment
    )
    assert child.returncode == 0
    assert b"\x1b[" not in child.stdout + child.stderr


def test_overrides_are_toml_values() -> None:
    """--set takes numbers, booleans, lists and bare words."""
    items = ["s.a.b=0.5", "s.c=true", "s.d=[1, 2]", "s.e=word", "s.f=1=2", "s.g=[1,\n2]"]
    values = {"s.a.b": 0.5, "s.c": True, "s.d": [1, 2], "s.e": "word", "s.f": "1=2", "s.g": [1, 2]}
    assert parse_overrides(items, "s") == values


@pytest.mark.parametrize(
    ("item", "words", "hint"),
    [
        ("diagnose.members", "no value", "--set diagnose.members=16"),
        ("=3", "no value", "r2s2r diagnose --show-config"),
        ("", "no value", "r2s2r diagnose --show-config"),
        ("diagnose.members=1\nx=2", "more than one value", "--set diagnose.members=16"),
        ("diagnose.members=1\n[table]", "more than one value", "--set diagnose.members=16"),
        ("diagnose.members=few\ndiagnose.x=2", "more than one value", "--set diagnose.members=16"),
        ("member=32", "no setting", "--set diagnose.members=32"),
        ("identify.starts=3", "no setting", "r2s2r diagnose --show-config"),
    ],
)
def test_an_override_that_would_be_ignored_is_refused(item: str, words: str, hint: str) -> None:
    """--set without KEY=VALUE, with several of them, without a section or of another stage is a usage error with the
    setting that was meant as hint, or with what lists them."""
    with pytest.raises(UsageError, match=words) as caught:
        parse_overrides([item], "diagnose")
    assert caught.value.hint == hint and caught.value.expected.startswith("diagnose.KEY=VALUE")


SHELL_CASES = {
    "deleted directory": ("mkdir gone && cd gone && rmdir ../gone && {r2s2r} status", 4),
    "forbidden directory": ("{r2s2r} import iterations/001 --project /proc/self/fdinfo", 4),
    "name of 300 characters": ("{r2s2r} init $(printf 'a%.0s' $(seq 300))", 4),
    "name that is no text": ("{r2s2r} init $'a\\xff'", 2),
    "closed stdout": ("{r2s2r} doctor --quick >&-", 0),
    "closed stderr": ("{r2s2r} doctor --quick 2>&-", 0),
    "ascii locale": ("PYTHONIOENCODING=ascii {r2s2r} init $'r\\xc3\\xb6bi' && cd r* && {r2s2r} status", 0),
    "full stdout of a document": ("{r2s2r} doctor --quick --json > /dev/full", 4),
    "an error that nobody hears": ("set -o pipefail; {r2s2r} inspect none.h5 --json 2>/dev/full | true", 4),
    "full stdout": ("{r2s2r} doctor --quick > /dev/full", 4),
    "a pipe as file": ("mkfifo pipe; {r2s2r} inspect pipe", 4),
    "a pipe to recover": ("mkfifo pipe; {r2s2r} recover pipe", 4),
    "an iteration of many digits": (
        "{r2s2r} init p && cd p && {r2s2r} status && {r2s2r} estimate --iteration 99999",
        2,
    ),
}


@pytest.mark.parametrize("name", list(SHELL_CASES))
def test_odd_surroundings_never_end_in_a_traceback(tmp_path: Path, name: str) -> None:
    """What a shell can do to a program: the documented exit code, no traceback, no hanging."""
    line, code = SHELL_CASES[name]
    command = line.format(r2s2r=f"'{sys.executable}' -m r2s2r_cli")
    shell = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path, timeout=180)
    assert "Traceback" not in shell.stderr
    assert shell.returncode == code, shell.stderr


@pytest.mark.parametrize(
    "arguments", [("validate",), ("import", "sample.csv", "--force", "--no-draw"), ("doctor", "--quick")]
)
def test_a_real_terminal_is_no_trouble(project: Path, arguments: tuple[str, ...]) -> None:
    """On a terminal, where the progress bar is drawn, commands end as they do in a pipe."""
    code, output = on_a_terminal(project, arguments)
    assert "Traceback" not in output
    assert code == 0, output


def on_a_terminal(folder: Path, arguments: tuple[str, ...]) -> tuple[int, str]:
    """Exit code and output of `r2s2r` on a pseudo terminal."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(folder)
        os.execv(sys.executable, [sys.executable, "-m", "r2s2r_cli", *arguments])
    output = b""
    with contextlib.suppress(OSError):  # Linux says EIO once the child has closed its side
        while part := os.read(terminal, 4096):
            output += part
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), output.decode(errors="replace")


def test_typer_errors_are_still_of_one_family() -> None:
    """Typer vendors click: the exceptions we translate are the ones it raises."""
    assert issubclass(typer.BadParameter, typer.TyperException)
