"""`r2s2r doctor ports`: the ports of the machine, and a robot on one of them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.errors import ExitCode
from r2s2r_cli.hardware import ports as found
from r2s2r_cli.rig.world import World
from r2s2r_cli.stages.calibrate.apply import with_sensor_line
from tests.commands.conftest import invoke
from tests.support.host_rig import running_rig
from tests.support.wire_robot import OFFSET, SLOPE, calibrated


def states(*arguments: str) -> dict[str, dict[str, Any]]:
    """Probes by name."""
    result = invoke("doctor", "ports", *arguments, "--json")
    assert result.exit_code in (ExitCode.DONE, ExitCode.GATE), result.stderr
    # An error follows as a second document.
    return {probe["name"]: probe for probe in json.JSONDecoder().raw_decode(result.stdout)[0]["probes"]}


def test_ports_that_may_not_be_opened_are_told_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each port with what it says of itself; no port at all is no error, for TCP and UDP need none."""
    monkeypatch.setattr(found, "serial_ports", lambda: (
        found.PortFound("/dev/ttyACM0", "Arduino", True), found.PortFound("/dev/ttyUSB0", "CP2102", False),
    ))  # fmt: skip
    probes = states()
    assert (probes["/dev/ttyACM0"]["state"], probes["/dev/ttyUSB0"]["state"]) == ("ok", "warning")
    assert "usermod" in probes["/dev/ttyUSB0"]["hint"] and probes["/dev/ttyACM0"]["found"] == "Arduino"
    monkeypatch.setattr(found, "serial_ports", lambda: ())
    assert states()["serial ports"]["state"] == "warning"


def test_a_port_of_this_machine_is_described(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What pyserial finds, sorted; permissions are looked at, nothing is opened."""
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    ports = []
    for name, mode in (("ttyUSB1", 0o600), ("ttyACM0", 0o600)):
        (tmp_path / name).write_text("")
        (tmp_path / name).chmod(mode)
        port = ListPortInfo(str(tmp_path / name))
        port.description, port.manufacturer, port.hwid = "Nano 33", "Arduino", "USB VID:PID=2341:805A"
        ports.append(port)
    plain = ListPortInfo("/dev/ttyS9")
    plain.hwid = "n/a"
    monkeypatch.setattr(list_ports, "comports", lambda: [*ports, plain])
    assert [(Path(p.device).name, p.description, p.allowed) for p in found.serial_ports()] == [
        ("ttyACM0", "Nano 33, Arduino", True), ("ttyUSB1", "Nano 33, Arduino", True),
    ]  # fmt: skip


def test_a_healthy_robot(project: Path) -> None:
    """Protocol, watchdog, boards, rate, sensors and their lengths, losses, latency, clock offset: there, and well."""
    path = project / "robot.toml"
    path.write_text(with_sensor_line(path.read_text(), dict.fromkeys(range(9), (SLOPE, OFFSET))))
    with running_rig(calibrated(), lock=False) as rig:
        probes = states(rig.address, "--seconds", "1")
    assert {"protocol", "watchdog", "samples", "control rate", "lines", "latency", "clock offset"} <= set(probes)
    assert probes["protocol"]["found"].startswith("checked 1, threebar")
    lengths = [re.search(r"([\d.]+) mm, noise", probe["found"]) for name, probe in probes.items() if "sensor" in name]
    assert len(lengths) == 9 and all(match and 100 < float(match[1]) < 300 for match in lengths)
    assert all(probe["state"] == "ok" for name, probe in probes.items() if "sensor" in name)


def test_a_robot_that_may_not_be_driven(project: Path) -> None:
    """A sensor of a winched cable that is not calibrated or not set up is an error, one of a passive cable a warning;
    exit code 3."""
    faults = [{"kind": "sensor_stuck", "sensor": i, "at_s": 0.0} for i in (2, 7)]
    with running_rig(calibrated(), World.model_validate({"faults": faults}), protocol="legacy") as rig:
        probes = states(rig.address, "--seconds", "1", "--protocol", "legacy")
        again = invoke("doctor", "ports", rig.address, "--seconds", "0.2", "--protocol", "legacy")
    assert again.exit_code == ExitCode.GATE and "not calibrated" in again.stderr
    assert probes["sensor 1 (cable 1)"]["state"] == "error"
    assert probes["sensor 1 (cable 1)"]["hint"] == "r2s2r calibrate --points points.csv"
    assert "0.20 pF" in probes["sensor 2 (cable 2)"]["found"]
    assert probes["sensor 2 (cable 2)"]["state"] == "error" and probes["sensor 7 (cable 7)"]["state"] == "warning"
    assert probes["watchdog"]["found"] == "none" and "cannot guarantee a stop" in probes["remark"]["found"]


def test_the_emergency_stop_is_taken_off_by_reset_alone(project: Path) -> None:
    """Latched: exit code 5 and the command to paste; with --reset it listens, and goes on listening afterwards."""
    from r2s2r_cli.hardware.open_link import open_link

    with running_rig(calibrated()) as rig:
        with open_link(rig.address, calibrated()) as link:
            link.emergency_stop()
        refused = invoke("doctor", "ports", rig.address)
        assert refused.exit_code == ExitCode.HARDWARE and f"r2s2r doctor ports {rig.address} --reset" in refused.stderr
        for options in (("--reset",), ()):
            assert states(rig.address, "--seconds", "0.2", *options)["samples"]["state"] == "ok"


def test_no_robot_is_a_failure_of_hardware(project: Path) -> None:
    """Exit code 5, the port, the reason, the next step; a name that is no port is an error of usage."""
    result = invoke("doctor", "ports", "/dev/no-such-port")
    assert result.exit_code == ExitCode.HARDWARE and "/dev/no-such-port" in result.stderr and "hint:" in result.stderr
    assert invoke("doctor", "ports", "http://robot").exit_code == ExitCode.USAGE
    assert invoke("doctor", "ports", "/dev/x", "--protocol", "boats").exit_code == ExitCode.USAGE
