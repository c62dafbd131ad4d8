"""`run`: which stages an iteration needs, in which order, and what ends it."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path
from typing import Any, ClassVar

import pytest

from r2s2r_cli.commands.unfinished import RESUMED
from r2s2r_cli.store.checkpoint import checkpoint_of
from r2s2r_cli.store.project import Project
from tests.commands.conftest import invoke
from tests.commands.test_mend import put, without_pictures
from tests.support import builders

Calls = list[list[str]]


class Child:
    """Stands for the process of a stage: notes its words, leaves with the code that was set."""

    calls: ClassVar[Calls] = []
    codes: ClassVar[dict[str, int]] = {}
    signal: ClassVar[int] = 0
    """That `run` gets while a child is at work."""
    told: ClassVar[list[int]] = []

    def __init__(self, words: list[str]) -> None:
        Child.calls.append(words[3:])

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_: object) -> None: ...

    def wait(self) -> int:
        """The code of this stage."""
        if Child.signal:
            os.kill(os.getpid(), Child.signal)
        return Child.codes.get(Child.calls[-1][0], 0)

    def send_signal(self, number: int) -> None:
        """Note it."""
        Child.told.append(number)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """The stages that were called, in order; none of them does anything."""
    Child.calls, Child.codes, Child.signal, Child.told = [], {}, 0, []
    monkeypatch.setattr(subprocess, "Popen", Child)
    return Child.calls


def stages(calls: Calls) -> list[str]:
    """Their names; the gate between them, which each test of it looks at, is none."""
    return [words[0] + (" executed" if "execute" in words[1:3] else "") for words in calls if words[0] != "validate"]


def test_a_robot_goes_through_all_stages(project: Path, calls: Calls) -> None:
    """In the order of the data, the estimate twice."""
    result = invoke("run", "--port", "socket://nowhere:1", "--camera", "rig://nowhere:2", "--yes", "--random", "3")
    assert result.exit_code == 0, result.stderr
    assert stages(Child.calls) == [
        "record", "estimate", "identify", "plan", "execute", "estimate executed", "compare",
    ]  # fmt: skip
    record, execute = Child.calls[0], Child.calls[4]
    assert record[1:3] == ["--random", "3"]
    assert execute[1:3] == ["--repeats", "1"], "the long policies: what `execute` takes by itself"
    assert "--yes" in execute
    assert all("socket://nowhere:1" in words for words in (record, execute))


def test_a_log_needs_no_robot(project: Path, calls: Calls) -> None:
    """It is imported; nothing is executed."""
    result = invoke("run", "sample.csv", "--until", "identify")
    assert result.exit_code == 0, result.stderr
    assert stages(Child.calls) == ["import", "estimate", "identify"]


@pytest.mark.parametrize("log", [("sample.csv",), ()])
def test_a_camera_names_no_robot(project: Path, calls: Calls, log: tuple[str, ...]) -> None:
    """Whoever imports a log and looks on moves none, though the project knows one: refused, before anything is done."""
    if log:
        text = (project / "project.toml").read_text()
        assert '\nport = ""' in text
        (project / "project.toml").write_text(text.replace('\nport = ""', '\nport = "socket://nowhere:1"'))
    result = invoke("run", *log, "--camera", "rig://nowhere:2", "--yes")
    assert result.exit_code == 2 and "none is named" in result.stderr
    assert Child.calls == []
    words = result.stderr.splitlines()[-1].removeprefix("hint: ").split()[1:]
    assert ("--port" in words) != bool(log) and ("--camera" in words) != bool(log)


def test_executed_runs_are_enough_to_learn_from(estimated: Path, calls: Calls) -> None:
    """An iteration before that has only these: the next one identifies and plans, as `identify` and make would."""
    place = estimated / "iterations" / "001"
    for source, target in (("10-record.h5", "50-execute.h5"), ("20-estimate.h5", "51-estimate.h5")):
        (place / source).rename(place / target)
    assert invoke("run", "--iteration", "2").exit_code == 0
    assert stages(Child.calls) == ["identify", "plan"]


@pytest.mark.parametrize("kind", ["identification", "plan", "comparison"])
def test_a_stage_that_was_interrupted_goes_on(estimated: Path, calls: Calls, kind: str) -> None:
    """The stage that left a checkpoint takes it up, no other one; what is damaged is not taken up."""
    kept = checkpoint_of(Project.find(estimated).iteration(1).artifact(kind))
    for head, resumed in (('{"key": "0"}', [RESUMED[kind]]), ("{", [])):
        kept.write_text(head, "utf-8")
        calls.clear()
        assert invoke("run").exit_code == 0
        assert [words[0] for words in calls if "--resume" in words] == resumed
        said = [line for line in invoke("run", "--dry-run").stderr.splitlines() if line.endswith("--resume")]
        assert [line.split()[2] for line in said] == resumed


def test_a_robot_that_has_moved_is_not_moved_again(estimated: Path, calls: Calls) -> None:
    """The recording is there: the rest goes on from it."""
    result = invoke("run", "--port", "socket://nowhere:1", "--until", "plan")
    assert result.exit_code == 0, result.stderr
    assert "not moved again" in result.stderr
    assert stages(Child.calls) == ["estimate", "identify", "plan"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP, signal.SIGINT])
def test_whoever_stops_it_stops_the_robot(project: Path, calls: Calls, number: int) -> None:
    """The process that drives the robot is told to end, whichever signal came, and is awaited; no stage follows."""
    Child.signal = number
    usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    before = signal.signal(number, usual)  # a suite that runs under nohup, or behind `&`, ignores some of them
    try:
        for code in (130, 0):
            Child.codes = {"record": code}
            result = invoke("run", "--port", "socket://nowhere:1", "--yes")
            assert result.exit_code == 130 and "stopped in: r2s2r record" in result.stderr
            assert stages(Child.calls) == ["record"] and signal.getsignal(number) == usual
            assert Child.told == [signal.SIGTERM, signal.SIGCONT]
            Child.calls.clear(), Child.told.clear()
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_whoever_stops_it_stops_a_stage_that_computes(project: Path, calls: Calls, number: int) -> None:
    """`kill -INT` reaches `run` alone, where Ctrl-C of a terminal reaches both: it is passed on as any other signal,
    and no stage follows, whether the stage was ended by it or was done in that very moment."""
    Child.signal = number
    for code in (130, -signal.SIGTERM, 0):
        Child.codes = {"import": code}
        result = invoke("run", "sample.csv", "--until", "estimate")
        assert result.exit_code == 130 and "stopped in: r2s2r import" in result.stderr
        assert stages(Child.calls) == ["import"] and Child.told[0] == signal.SIGTERM
        Child.calls.clear(), Child.told.clear()


def test_what_is_ignored_stays_so(project: Path, calls: Calls) -> None:
    """`nohup r2s2r run` outlives its terminal."""
    Child.signal, Child.codes = signal.SIGHUP, {}
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert invoke("run", "sample.csv", "--until", "estimate").exit_code == 0
    finally:
        signal.signal(signal.SIGHUP, before)
    assert Child.told == []


CUT_OFF = {"runs": [{"run": "gait", "ended": "interrupted"}], "not_begun": ["gait-2"]}
"""Of a report of `record`."""


def test_a_recording_that_was_cut_off_is_done_again(project: Path, calls: Calls) -> None:
    """`record --force` keeps what there was beside it. Without a robot it is used as it is."""
    put(project, "10-record.h5", builders.recording(), "record", report=CUT_OFF)
    assert invoke("run", "--until", "plan").exit_code == 0
    assert stages(Child.calls) == ["estimate", "identify", "plan"]
    Child.calls.clear()
    result = invoke("run", "--port", "socket://nowhere:1", "--until", "plan")
    said = " ".join(result.stderr.split())
    assert result.exit_code == 0, result.stderr
    assert "was cut off (gait: interrupted; gait-2: not begun): it is done again" in said
    assert stages(Child.calls) == ["record", "estimate", "identify", "plan"]
    assert "--force" in Child.calls[0]


def test_a_recording_that_was_cut_off_and_used_stays(project: Path, calls: Calls) -> None:
    """Somebody estimated states from it: they know. The way to another one is said."""
    put(project, "10-record.h5", builders.recording(), "record", report=CUT_OFF)
    put(project, "20-estimate.h5", builders.estimate(), "estimate")
    result = invoke("run", "--port", "socket://nowhere:1", "--until", "plan")
    said = " ".join(result.stderr.split())
    assert result.exit_code == 0, result.stderr
    assert "r2s2r record --random 15 --port socket://nowhere:1 --iteration 1 --force" in said
    assert stages(Child.calls) == ["estimate", "identify", "plan"]


def test_the_next_iteration_records_nothing(estimated: Path, calls: Calls) -> None:
    """It learns from the runs of the one before."""
    result = invoke("run", "--iteration", "2", "--port", "socket://nowhere:1", "--until", "execute", "--yes")
    assert result.exit_code == 0, result.stderr
    assert stages(Child.calls) == ["identify", "plan", "execute"]


def test_a_later_iteration_without_a_robot_ends_with_its_plan(estimated: Path, calls: Calls) -> None:
    """There is no run of its own to compare with."""
    result = invoke("run", "--iteration", "2")
    assert result.exit_code == 0, result.stderr
    assert stages(Child.calls) == ["identify", "plan"]


@pytest.mark.parametrize(("code", "wanted"), [(3, 3), (4, 4), (5, 5), (6, 6), (130, 130), (-15, 130), (-9, 1)])
def test_the_first_failure_ends_it_with_its_code(estimated: Path, calls: Calls, code: int, wanted: int) -> None:
    """What comes after is not begun. A stage that somebody ended counts as interrupted, one that the system killed as
    failed: nobody would look for want of memory else."""
    Child.codes["identify"] = code
    result = invoke("run")
    assert result.exit_code == wanted
    assert ("memory" in result.stderr) == (code == -9)
    assert stages(Child.calls)[-1] == "identify"


def test_nothing_is_learned_from_runs_that_do_not_pass(estimated: Path, calls: Calls) -> None:
    """The recording and its states are validated; where that finds an error the run ends there, with 3."""
    Child.codes["validate"] = 3
    result = invoke("run")
    assert result.exit_code == 3
    assert [words[0] for words in Child.calls] == ["estimate", "validate"]
    assert Child.calls[-1][1:3] == ["iterations/001/10-record.h5", "iterations/001/20-estimate.h5"]
    Child.calls.clear()
    Child.codes["validate"] = 0
    assert invoke("run", "--until", "identify").exit_code == 0
    assert [words[0] for words in Child.calls] == ["estimate", "validate", "identify"]


def test_without_robot_and_log_nothing_begins(project: Path, calls: Calls) -> None:
    """Exit code 2, with what to give."""
    result = invoke("run")
    assert result.exit_code == 2
    assert Child.calls == []
    assert "--port" in result.stderr


def test_dry_run_says_the_commands(estimated: Path, calls: Calls) -> None:
    """Each can be pasted."""
    result = invoke("run", "--dry-run")
    assert result.exit_code == 0
    assert Child.calls == []
    assert "r2s2r identify --iteration 1" in result.stderr


@pytest.mark.parametrize("executed", [False, True])
def test_states_whose_pictures_are_gone_are_left_as_they_are(project: Path, calls: Calls, executed: bool) -> None:
    """Their stage could only fail; a line says so, and the rest goes on."""
    without_pictures(project, "execute" if executed else "record")
    if executed:
        (project / "iterations/001/10-record.h5").unlink()
    result = invoke("run", *(["--iteration", "1", "--port", "socket://nowhere:1"] if executed else []))
    assert result.exit_code == 0, result.stderr
    name = "51-estimate.h5 is used as it is" if executed else "20-estimate.h5 is used as it is"
    assert name in result.stderr and "cannot be made again here" in result.stderr
    assert ("estimate executed" if executed else "estimate") not in stages(Child.calls)
    assert stages(Child.calls)[-1] == "compare"


def test_an_unknown_stage_is_refused(project: Path, calls: Calls) -> None:
    """With the names."""
    result: Any = invoke("run", "--until", "diagnoze")
    assert result.exit_code == 2
    assert "compare" in result.stderr
