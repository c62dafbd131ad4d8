"""`record` in a project with a robot of straight lines: what it writes, what it refuses, how it ends."""

from __future__ import annotations

import dataclasses
import json
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands import record_look, record_run
from r2s2r_cli.commands.record_live import Live
from r2s2r_cli.commands.status import survey
from r2s2r_cli.console import Console
from r2s2r_cli.devices.link import LinkError, Sample
from r2s2r_cli.stages.repeated import asked_repeats, policy_of
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from schemas.robot import Robot
from tests.commands.conftest import document, invoke
from tests.support.fake_robot import FakeLink, calibrated

RECORDING = "iterations/001/10-record.h5"
ASK = ("record", "--random", "2", "--port", "fake", "--set", "record.rest_s=0.3")
Maker = Callable[..., FakeLink]


def with_lines(text: str, robot: Robot) -> str:
    """robot.toml with the sensors' lines of `robot`."""
    lines = iter(f"slope_f_per_m = {s.slope_f_per_m!r}\noffset_f = {s.offset_f!r}\n" for s in robot.sensors)
    return re.sub(r"\[\[sensors\]\].*\ncable = \d+\n", lambda found: found[0] + next(lines), text)


@pytest.fixture
def robot_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of a calibrated robot, as the working directory."""
    root = tmp_path / "robot"
    assert invoke("init", str(root)).exit_code == 0
    path = root / "robot.toml"
    path.write_text(with_lines(path.read_text(), calibrated()))
    monkeypatch.chdir(root)
    return root


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Maker:
    """Puts a robot of straight lines behind every port; the keywords are those of FakeLink. Returns the link."""

    def put(**options: Any) -> FakeLink:
        made = FakeLink(calibrated(), **options)
        monkeypatch.setattr("r2s2r_cli.hardware.open_link.open_link", lambda *_, **__: made)
        return made

    return put


def test_a_recording_is_whole_and_valid(robot_project: Path, link: Maker) -> None:
    """Two repeats: sealed runs with policy, intervals and clocks, a report, a picture each, and nothing to validate."""
    link()
    result = document(*ASK, "--repeats", "2")
    assert result["state"] == "done" and result["artifact"] == RECORDING
    assert [run["ended"] for run in result["report"]["runs"]] == ["complete", "complete"]
    header, data = read_artifact(robot_project / RECORDING, "recording")
    assert data.runs() == ["random-0-1", "random-0-2"]
    for run in data.runs():
        attributes = data.groups[f"runs/{run}"].attributes
        assert attributes["origin"] == "robot" and attributes["clock"] == "host" and attributes["start_unix"] > 1.6e9
        intervals, policy = data.group(run, "intervals"), data.group(run, "policy")
        assert intervals is not None and policy is not None
        assert np.array_equal(intervals["target"], policy["target"])
    assert header.provenance.seed == 0 and header.provenance.report == result["report"]
    assert all((robot_project / name).exists() for name in result["drawings"])
    assert len(result["drawings"]) == 3
    found = document("validate", RECORDING)
    assert {one["check"] for one in found["findings"]} == {"sensors_move"}  # the passive cables of this robot do not


def test_pictures_never_show_another_recording(robot_project: Path, link: Maker) -> None:
    """What was drawn of a recording that is replaced goes; the recording itself keeps another name."""
    link()
    document(*ASK)
    folder = (robot_project / RECORDING).parent
    assert list(folder.glob("10-record*.png")) and (folder / "10-record.html").exists()
    document(*ASK, "--force", "--no-draw")
    assert not [*folder.glob("10-record*.png"), *folder.glob("10-record.html")]
    assert (folder / "10-record.h5.replaced").exists()


@pytest.mark.parametrize("silent", [None, 7])
def test_a_sensor_is_judged_by_the_messages_of_its_board(robot_project: Path, link: Maker, silent: int | None) -> None:
    """Three boards take turns, so that every sensor is missing in two rows of three: nothing to warn of. One that is
    heard in every fifth message of its board (no winched cable's: the run goes on) is named, and no other."""

    def drop(number: int, sample: Sample) -> Sample:
        if silent is None or not sample.fresh[silent] or number % 5 == 0:
            return sample
        lost = np.arange(9) == silent
        return dataclasses.replace(sample, fresh=sample.fresh & ~lost)

    link(boards=3, on_read=drop)
    assert invoke(*ASK, "--no-draw").exit_code == 0
    found = document("validate", RECORDING)["findings"]
    expected = [] if silent is None else [("sensors_received", f"sensor {silent} was mostly not received")] * 2
    assert [(one["check"], one["what"]) for one in found if one["check"] != "sensors_move"] == expected


@pytest.mark.parametrize(("firmware", "origin"), [("original-2.1", "robot"), ("", "robot"), ("r2s2r-rig", "rig")])
def test_a_rig_is_known_by_its_firmware(robot_project: Path, link: Maker, firmware: str, origin: str) -> None:
    """By its whole name: a real robot whose firmware has "rig" in it is none."""
    made = link()
    made.facts = dataclasses.replace(made.facts, device=firmware)
    document(*ASK, "--no-draw")
    _, data = read_artifact(robot_project / RECORDING, "recording")
    assert data.groups["runs/random-0"].attributes["origin"] == origin


def test_a_recording_does_not_go_stale(robot_project: Path, link: Maker) -> None:
    """Other settings and another robot.toml later: what the robot did stays what it did."""
    link()
    document(*ASK, "--no-draw")
    text = (robot_project / "project.toml").read_text()
    (robot_project / "project.toml").write_text(text.replace("rest_s = 2.0", "rest_s = 9.0"))
    path = robot_project / "robot.toml"
    path.write_text(path.read_text().replace("rate_hz = 50.0", "rate_hz = 40.0"))
    status = document("status")
    (state,) = status["artifacts"]
    assert state["state"] == "fresh" and state["stage"] == "record"
    assert status["next"] == ""  # a single run repeats nothing, and holds no camera to estimate states from


def test_nothing_is_overwritten(robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second recording is refused before anything moves, with a hint that records elsewhere what was asked for; with
    --force the first keeps another name."""
    monkeypatch.setattr("sys.argv", ["r2s2r", *ASK])
    first = link()
    document(*ASK, "--no-draw")
    before = read_header(robot_project / RECORDING).content_sha256
    made = link()
    refused = invoke(*ASK)
    assert refused.exit_code == 2 and "--iteration 2" in refused.stderr
    assert made.commands == [] and first.commands != []
    hint = shlex.split(refused.stderr.split("hint: ")[-1], comments=True)
    assert hint == ["r2s2r", *ASK, "--iteration", "2"]
    document(*hint[1:], "--no-draw")
    link()
    document(*ASK, "--no-draw", "--force", "--seed", "1", "--iteration", "1")
    assert read_header(robot_project / f"{RECORDING}.replaced").content_sha256 == before
    assert read_header(robot_project / RECORDING).content_sha256 != before


def test_a_dead_link_leaves_a_sealed_recording_and_exit_code_5(robot_project: Path, link: Maker) -> None:
    """The port dies in the middle: motors stopped, all until then sealed, port and next step in the message."""

    def die(number: int, sample: Sample) -> Sample:
        if number > 60:
            raise LinkError(
                "the port is gone", where="fake", expected="a robot", received="EOF", hint="r2s2r doctor ports"
            )
        return sample

    made = link(on_read=die)
    result = invoke(*ASK, "--no-draw")
    assert result.exit_code == 5
    assert (
        "the port is gone" in result.stderr and "where: fake" in result.stderr and "r2s2r doctor ports" in result.stderr
    )
    assert not made.driven.any()
    header, data = read_artifact(robot_project / RECORDING, "recording")
    sensors = data.group("random-0", "sensors")
    assert sensors is not None and len(sensors["t"]) == 60
    assert header.provenance.report["runs"][0]["ended"] == "the port is gone"
    assert list((robot_project / "iterations" / "001").glob("*.journal")) == []


def test_ctrl_c_seals_what_there_is(robot_project: Path, link: Maker) -> None:
    """An interrupt between two samples: exit code 130, motors off, the recording sealed."""

    def interrupt(number: int, sample: Sample) -> Sample:
        if number == 40:
            raise KeyboardInterrupt
        return sample

    made = link(on_read=interrupt)
    result = invoke(*ASK, "--no-draw")
    assert result.exit_code == 130 and "sealed" in result.stderr
    assert not made.driven.any()
    assert read_header(robot_project / RECORDING).provenance.report["runs"][0]["ended"] == "interrupted"
    (line,) = survey(Project.find(robot_project)).artifacts
    assert line.state == "fresh" and line.notes[0].endswith(": interrupted")
    assert "ended at target" in invoke("status").stdout


def test_the_first_of_several_repeats_is_a_run_of_its_policy(robot_project: Path, link: Maker) -> None:
    """Interrupted in it: the file knows how many there were to be."""

    def interrupt(number: int, sample: Sample) -> Sample:
        if number == 40:
            raise KeyboardInterrupt
        return sample

    link(on_read=interrupt)
    assert invoke(*ASK, "--no-draw", "--repeats", "3").exit_code == 130
    header, data = read_artifact(robot_project / RECORDING, "recording")
    repeats = asked_repeats(header.provenance.settings)
    assert [policy_of(data, run, repeats) for run in data.runs()] == ["random-0"] and repeats == 3


def test_a_stuck_sensor_stops_the_robot(robot_project: Path, link: Maker) -> None:
    """0.20 pF from the middle on: the duty of the host ends the run with exit code 5, within 250 ms of the run."""

    def stuck(number: int, sample: Sample) -> Sample:
        capacitance = sample.capacitance.copy()
        capacitance[0] = 0.20e-12 if number > 50 else capacitance[0]
        return Sample(**{**vars(sample), "capacitance": capacitance})

    made = link(on_read=stuck)
    result = invoke(*ASK, "--no-draw")
    assert result.exit_code == 5 and "stopped" in result.stderr
    assert made.count <= 50 + 0.25 / made.period and not made.driven.any()
    assert (robot_project / RECORDING).exists()


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_runs_without_a_camera_are_warned_of_before_they_move(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...]
) -> None:
    """Nobody can estimate states of them: it is said while there is time to add one."""
    said: list[str] = []
    made = link()
    monkeypatch.setattr(Console, "warn", lambda self, text: said.append(f"{text} ({len(made.commands)} commands)"))
    assert invoke(*ASK, *more).exit_code == 0
    assert bool(made.commands) == (not more)
    told = [text for text in said if "no states can be estimated" in text]
    assert len(told) == 1 and told[0].endswith("(0 commands)") and "--camera realsense" in told[0]


@pytest.mark.parametrize(
    ("port", "camera"),
    [
        ("socket://127.0.0.1:4000", "--camera rig://127.0.0.1:9000 (the camera as `r2s2r rig"),
        ("socket://localhost:4000", "--camera rig://"),
        ("/dev/pts/3", "--camera rig://"),
        ("/dev/ttyUSB0", "--camera realsense"),
        ("udp://0.0.0.0:2390", "--camera realsense"),
    ],
)
def test_a_rig_is_advised_its_own_camera(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch, port: str, camera: str
) -> None:
    """No other one sees the robot of a rig: as `estimate` says it of the recording, said before there is one."""
    said: list[str] = []
    link()
    monkeypatch.setattr(record_look, "LOOK_S", 0.05)
    monkeypatch.setattr(Console, "warn", lambda self, text: said.append(text))
    assert invoke("record", "--random", "2", "--port", port, "--dry-run").exit_code == 0
    assert [camera in text for text in said if "no states can be estimated" in text] == [True]


def test_dry_run_moves_nothing(robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan, the lengths of the sensors, no motor command but zeros, no file."""
    made = link()
    monkeypatch.setattr(record_look, "LOOK_S", 0.05)
    result = invoke(*ASK, "--dry-run")
    assert result.exit_code == 0, result.stderr
    assert "random-0" in result.stdout and "250.0" in result.stdout  # the passive cables of the fake
    assert not np.array(made.commands).any()
    assert not (robot_project / RECORDING).exists()
    without = invoke("record", "--excite", "commission", "--dry-run")
    assert without.exit_code == 0 and all(name in without.stdout for name in ("ramps", "holds", "reversals", "repeats"))


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--port", "fake"), "nothing to record"),
        (("--random", "3"), "no robot is named"),
        (("--random", "0", "--port", "fake"), "random policy"),
        (("--random", "3", "--repeats", "0", "--port", "fake"), "repeats"),
    ],
)
def test_what_cannot_be_recorded_is_said(robot_project: Path, arguments: tuple[str, ...], word: str) -> None:
    """Exit code 2, before any port is opened; with --json as a document."""
    result = invoke("record", *arguments, "--json")
    assert result.exit_code == 2
    assert word in json.loads(result.stdout)["what"]


def test_a_policy_file_is_run_as_it_stands(robot_project: Path, link: Maker) -> None:
    """Its targets between the rest shapes, its repeats one after the other; one for another robot is refused."""
    link()
    text = 'schema_version = 1\nrobot = "threebar"\nname = "bend"\nrepeat = 2\n[[steps]]\ntarget = {}\n'
    (robot_project / "bend.toml").write_text(text.format([0.4, 1.0, 1.0, 1.0, 1.0, 1.0]))
    document("record", "bend.toml", "--port", "fake", "--no-draw", "--set", "record.rest_s=0.2")
    _, data = read_artifact(robot_project / RECORDING, "recording")
    policy = data.group("bend", "policy")
    assert policy is not None and policy["target"][:, 0].tolist() == [1.0, 0.4, 0.4, 1.0]
    (robot_project / "other.toml").write_text(text.format([0.4]).replace("threebar", "sixbar"))
    refused = invoke("record", "other.toml", "--port", "fake")
    assert refused.exit_code == 4 and "another robot" in refused.stderr


@pytest.mark.parametrize(("ends", "rest", "targets"), [(1.0, 0.2, 3), (0.5, 0.2, 5), (1.0, 0.0, 3)])
def test_the_time_left_counts_the_targets_that_are_run(
    robot_project: Path, link: Maker, monkeypatch: pytest.MonkeyPatch, ends: float, rest: float, targets: int
) -> None:
    """The rest shapes that are run, whether the policy has them, the recording adds them, or nobody."""
    link()
    counts: list[list[int]] = []

    class Noted(Live):
        def __init__(self, targets: Sequence[int]) -> None:
            counts.append(list(targets))
            super().__init__(targets)

    monkeypatch.setattr(record_run, "Live", Noted)
    text = 'schema_version = 1\nrobot = "threebar"\nname = "bend"\n'
    text += "".join(f"[[steps]]\ntarget = {[one] * 6}\n" for one in (ends, 0.4, ends))
    (robot_project / "bend.toml").write_text(text)
    made = document("record", "bend.toml", "--port", "fake", "--no-draw", "--set", f"record.rest_s={rest}")
    assert counts == [[targets]] and made["report"]["runs"][0]["targets"] == targets


def test_an_uncalibrated_robot_is_refused_before_it_moves(
    tmp_path: Path, link: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 4 and the command that calibrates; no journal is left."""
    assert invoke("init", str(tmp_path / "raw")).exit_code == 0
    monkeypatch.chdir(tmp_path / "raw")
    made = link()
    result = invoke(*ASK)
    assert result.exit_code == 4 and "r2s2r calibrate" in result.stderr
    assert made.commands == [] and list((tmp_path / "raw").rglob("*.journal")) == []


def test_the_floor_of_three_repeats(robot_project: Path, link: Maker) -> None:
    """`floor` on them: lengths only, from repeats of a policy, and nothing in it for a robot that repeats itself."""
    link()
    document(*ASK, "--no-draw", "--repeats", "3")
    result = document("floor")
    lengths = result["report"]["lengths"]
    assert lengths["basis"] == "repeats of a policy" and result["report"]["caps"] is None
    assert lengths["floor_m"] < 0.002  # one control tick of a cable is 1.2 mm
    assert document("floor")["state"] == "fresh"
    assert (robot_project / "floor.png").exists() and (robot_project / "floor.html").exists()
