"""`r2s2r doctor ports`: which ports there are, and whether a robot on one of them is fit to be driven."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import GateError
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from schemas.results import DoctorResult, Probe

if TYPE_CHECKING:
    from r2s2r_cli.hardware.examine import LinkHealth
    from schemas.robot import Robot

State = Literal["ok", "warning", "error"]
_CALIBRATE = "r2s2r calibrate --points points.csv"
NO_PORTS = "serial ports"
"""The probe that says that there are none."""
LOW_RATE = 0.8
"""Of the control rate: below it the gains of the controller, which count ticks, belong to another robot."""
SLOW_S = 0.1
"""Latency above which a cable of the 3-bar robot has moved by 6 mm before its stop arrives [s]."""


def ports(
    port: Annotated[
        str | None, typer.Argument(metavar="[PORT]", help="Device, socket://HOST:PORT or udp://HOST:PORT of a robot.")
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option("--protocol", help="checked (ours), boards or legacy (the authors'). Default: project.toml."),
    ] = None,
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=600, help="How long to listen to the robot; motors are off.")
    ] = 3.0,
    reset: Annotated[bool, typer.Option("--reset", help="Take the robot's emergency stop off first.")] = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """List the ports of this machine; or listen to the robot on one of them: protocol, boards, sensors, losses, clocks.

    The robot is that of the project. Nothing moves.

    Example: r2s2r doctor ports /dev/ttyUSB0
    """
    console = Console(json=json, quiet=quiet)
    if port is None:
        probes = list(machine())
    else:
        from r2s2r_cli.commands.robot_link import link_of
        from r2s2r_cli.store.project import Project

        here = Project.find(project)
        link, robot = link_of(here, port, protocol), here.robot()
        probes = list(_robot(robot, _listen(robot, port, link.protocol, seconds, reset)))
    console.document(DoctorResult(probes=tuple(probes)))
    console.table("", ["what", "state", "found"], [[p.name, p.state, p.found] for p in probes])
    for hint in dict.fromkeys(probe.hint for probe in probes if probe.hint):
        console.hint(hint)
    failed = [p for p in probes if p.state == "error"]
    if failed:
        raise GateError(f"{len(failed)} things keep the robot from being driven", where=failed[0].name,
                        expected="working", received=failed[0].found, hint=failed[0].hint)  # fmt: skip


def machine() -> Iterator[Probe]:
    """The serial ports of this machine, and whether this user may open them; none is opened."""
    from r2s2r_cli.hardware.ports import serial_ports

    found = serial_ports()
    for port in found:
        yield Probe(name=port.device, state="ok" if port.allowed else "warning",
                    found=port.description + ("" if port.allowed else ", which this user may not open"),
                    hint="" if port.allowed else 'sudo usermod -aG dialout "$USER"  # then log in again')  # fmt: skip
    if not found:
        yield Probe(name=NO_PORTS, state="warning", found="none; TCP and UDP need none",
                    hint="r2s2r rig  # a virtual robot to try things on")  # fmt: skip


def _listen(robot: Robot, port: str, protocol: str, seconds: float, reset: bool) -> LinkHealth:
    """Raises HardwareError where there is no healthy robot to listen to."""
    from r2s2r_cli.hardware.examine import examine
    from r2s2r_cli.hardware.open_link import open_link
    from r2s2r_cli.hardware.signals import interrupting_signals

    link = open_link(port, robot, protocol=protocol)
    with interrupting_signals():
        if reset:
            try:
                link.reset()
                return examine(link, len(robot.motors), seconds)
            finally:
                link.__exit__(None, None, None)
        with link:
            return examine(link, len(robot.motors), seconds)


def _robot(robot: Robot, health: LinkHealth) -> Iterator[Probe]:
    from r2s2r_cli.hardware.look import look_at

    facts, counts, rate = health.facts, health.statistics, robot.pid.rate_hz
    again = look_at(facts.port, facts.protocol)
    version = f" {facts.version}" if facts.version else ""
    device = f", {facts.robot}, firmware {facts.device}" if facts.device else ""
    yield Probe(name="protocol", state="ok", found=f"{facts.protocol}{version}{device}")
    yield Probe(name="watchdog", state="ok" if facts.stops_by_itself else "warning",
                found=f"{facts.watchdog * 1e3:.0f} ms" if facts.watchdog else "none")  # fmt: skip
    for remark in facts.remarks:
        yield Probe(name="remark", state="warning", found=remark)
    if facts.lock_step:
        yield Probe(name="lock-step", state="ok", found="the rig waits for the host; its clock is the world's")
    boards = ", ".join(f"board {i}: {found:.1f}/s" for i, found in health.rates.items())
    yield Probe(name="samples", state="ok" if boards else "error", found=boards or "none", hint="" if boards else again)
    slow = health.ticks < LOW_RATE * rate
    yield Probe(name="control rate", state="warning" if slow else "ok",
                found=f"{health.ticks:.1f}/s of {rate:g}/s", hint=again if slow else "")  # fmt: skip
    yield from _sensors(robot, health)
    bad = (counts.lost or 0) + counts.corrupt + counts.overlong
    lost = "not told by this protocol" if counts.lost is None else \
        f"{counts.lost} lost, {counts.repeated} repeated, {counts.reordered} late"  # fmt: skip
    yield Probe(name="lines", state="ok" if bad == 0 else "warning",
                found=f"{counts.received} good, {counts.corrupt} corrupt; {lost}")  # fmt: skip
    if counts.latency_median is not None and counts.latency_p99 is not None:
        typical, most = counts.latency_median * 1e3, counts.latency_p99 * 1e3
        yield Probe(name="latency", state="ok" if counts.latency_p99 < SLOW_S else "warning",
                    found=f"median {typical:.1f} ms, 99 % below {most:.1f} ms")  # fmt: skip
    if counts.clock_offset is not None:
        drift = f", drift {counts.clock_drift * 1e6:+.0f} ppm" if counts.clock_drift is not None else ""
        jumps = f", {counts.clock_jumps} jumps" if counts.clock_jumps else ""
        yield Probe(name="clock offset", state="warning" if jumps else "ok",
                    found=f"host minus board {counts.clock_offset:.4f} s{drift}{jumps}")  # fmt: skip
    if health.voltage is not None:
        yield Probe(name="battery", state="ok", found=f"{health.voltage:.2f} V")


def _sensors(robot: Robot, health: LinkHealth) -> Iterator[Probe]:
    """One line a sensor: what it reads, and the length where it is calibrated."""
    limits = robot.limits
    for i, sensor in enumerate(robot.sensors):
        name, winched = f"sensor {i} (cable {sensor.cable})", sensor.cable in robot.actuated
        value = health.median[i] if i < len(health.median) else float("nan")
        worst: State = "error" if winched else "warning"
        if value != value:
            yield Probe(name=name, state=worst, found="no reading", hint=f"look at the plug of sensor {i}")
        elif i in health.not_set_up:
            yield Probe(name=name, state=worst, found="0.20 pF: the sensor chip is not set up",
                        hint="switch the board off and on again")  # fmt: skip
        elif not sensor.slope_f_per_m or sensor.offset_f is None:
            yield Probe(name=name, state=worst, found=f"{value * 1e12:.2f} pF, not calibrated",
                        hint=_CALIBRATE if winched else "")  # fmt: skip
        else:
            length = (value - sensor.offset_f) / sensor.slope_f_per_m
            noise = health.noise[i] / abs(sensor.slope_f_per_m)
            inside = limits.cable_length_min_m <= length <= limits.cable_length_max_m
            yield Probe(
                name=name, state="ok" if inside else worst,
                found=f"{value * 1e12:.2f} pF, {length * 1e3:.1f} mm, noise {noise * 1e3:.1f} mm"
                + ("" if inside else ", outside the limits of robot.toml"),
                hint="" if inside else _CALIBRATE,
            )  # fmt: skip
