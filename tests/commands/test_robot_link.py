"""The robot of project.toml: taken where the command line names none, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.commands import COMMANDS
from r2s2r_cli.commands.robot_link import Protocol, RobotLink, link_of
from r2s2r_cli.errors import ExitCode, InputError
from r2s2r_cli.rig.world import World
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke
from tests.commands.test_record import with_lines
from tests.support.host_rig import running_rig
from tests.support.wire_robot import calibrated


def linked(root: Path, port: str, protocol: str) -> None:
    """Writes the section `link`, which `init` has made."""
    path = root / "project.toml"
    text = path.read_text().replace('port = ""', f'port = "{port}"')
    path.write_text(text.replace('protocol = "checked"', f'protocol = "{protocol}"'))


def test_the_command_line_goes_before_the_project(project: Path) -> None:
    """Each of both by itself; without either nobody is named, and a new project talks like the virtual robot."""
    assert link_of(Project.find(project), None, None) == RobotLink(None, "checked")
    linked(project, "/dev/ttyUSB7", "legacy")
    here = Project.find(project)
    assert link_of(here, None, None) == RobotLink("/dev/ttyUSB7", "legacy")
    assert link_of(here, "udp://:1", None) == RobotLink("udp://:1", "legacy")
    assert link_of(here, None, Protocol.BOARDS) == RobotLink("/dev/ttyUSB7", "boards")


def test_a_wrong_protocol_is_refused(project: Path) -> None:
    """With the names that there are."""
    linked(project, "", "boats")
    with pytest.raises(InputError, match="link"):
        Project.find(project)


def test_a_recording_of_the_projects_robot(project: Path) -> None:
    """Neither port nor protocol on the command line: `doctor ports` and `record` talk to it, and the recording keeps
    which robot it was."""
    path = project / "robot.toml"
    path.write_text(with_lines(path.read_text(), calibrated()))
    with running_rig(calibrated(), World(), protocol="legacy") as rig:
        linked(project, rig.address, "legacy")
        assert invoke("doctor", "ports", rig.address, "--seconds", "0.2").exit_code == ExitCode.DONE
        document("record", "--random", "1", "--no-draw", "--set", "record.rest_s=0.2")
    made, _ = read_artifact(project / "iterations/001/10-record.h5", "recording")
    flags = made.provenance.settings["flags"]
    assert (flags["port"], flags["protocol"]) == (rig.address, "legacy")


def test_an_imported_log_moves_no_robot(project: Path) -> None:
    """`run` with logs neither records nor executes, whatever robot the project has; without logs it does both."""
    linked(project, "/dev/ttyUSB7", "legacy")
    said = invoke("run", "sample.csv", "--dry-run").stderr
    assert "r2s2r import" in said and "record" not in said and "execute" not in said.replace("--of execute", "")
    said = invoke("run", "--dry-run").stderr
    assert "--port /dev/ttyUSB7 --protocol legacy" in said and "r2s2r execute" in said


def test_examples_of_a_robot_say_how_it_talks() -> None:
    """A real one does not talk as the rig does: without --protocol the example would end in silence."""
    examples = [line for command in COMMANDS.values() for line in (command.__doc__ or "").splitlines()
                if "Example:" in line and "/dev/ttyUSB" in line and " rig " not in line]  # fmt: skip
    assert any(" record " in line for line in examples) and any(" execute " in line for line in examples)
    assert all("--protocol legacy" in line for line in examples)
