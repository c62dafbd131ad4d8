"""The tables of a world file that break things: at a given time, or on the wire at random."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from r2s2r_cli.rig.section import Index, NonNegative, Positive, Real, Section, Share

For = Annotated[float, Field(strict=True, gt=0)]


class Timed(Section):
    """A fault that begins at a time of the rig."""

    at_s: NonNegative
    """When it begins, in the rig's time [s]."""
    for_s: For = 1e9
    """How long it lasts [s]; left out: for good."""

    def on(self, t: float) -> bool:
        """Whether it is there at time t [s]."""
        return self.at_s <= t < self.at_s + self.for_s


class SensorStuck(Timed):
    """A sensor's chip is not initialised and sends 0.20 pF."""

    kind: Literal["sensor_stuck"]
    sensor: Index
    """Place in `[[sensors]]` of `robot.toml`."""


class SensorFrozen(Timed):
    """A sensor goes on sending its last value."""

    kind: Literal["sensor_frozen"]
    sensor: Index
    """Place in `[[sensors]]` of `robot.toml`."""


class SensorJump(Timed):
    """A clip slipped: a sensor reads longer by a length."""

    kind: Literal["sensor_jump"]
    sensor: Index
    """Place in `[[sensors]]` of `robot.toml`."""
    by_m: Real = 0.02
    """How much longer [m]."""


class BoardSilent(Timed):
    """A board sends nothing; its motors keep their last command, as the authors' do."""

    kind: Literal["board_silent"]
    board: Index
    """Its number."""


class BoardReset(Timed):
    """A board starts anew: its clock from 0, its motors off until the next command, silent for `for_s`."""

    kind: Literal["board_reset"]
    board: Index
    """Its number."""
    for_s: For = 1.5


class ClockJump(Timed):
    """A board's clock jumps."""

    kind: Literal["clock_jump"]
    board: Index
    """Its number."""
    by_s: Real = 5.0
    """Forwards, or, below 0, backwards [s]."""


class MotorDead(Timed):
    """A motor does not turn."""

    kind: Literal["motor_dead"]
    motor: Index
    """Place in `[[motors]]` of `robot.toml`."""


class CableTorn(Timed):
    """A cable no longer pulls; for good, whatever `for_s`."""

    kind: Literal["cable_torn"]
    cable: Index
    """Its number."""


class LinkGone(Timed):
    """The cable is pulled: the port is closed and refused."""

    kind: Literal["link_gone"]


class LinkStalled(Timed):
    """The rig reads nothing and sends nothing, while the port stays open."""

    kind: Literal["link_stalled"]


Fault = Annotated[
    SensorStuck | SensorFrozen | SensorJump | BoardSilent | BoardReset | ClockJump | MotorDead | CableTorn
    | LinkGone | LinkStalled,
    Field(discriminator="kind"),
]  # fmt: skip


class Wire(Section):
    """What happens to messages, in both directions, each with its probability a message."""

    lost: Share = 0.0
    """Never arrives."""
    garbage: Share = 0.0
    """Bytes at random come before it."""
    split: Share = 0.0
    """Arrives in two parts with a pause (streams), or cut off (datagrams)."""
    duplicate: Share = 0.0
    """Arrives twice."""
    reorder: Share = 0.0
    """Arrives after the next one."""
    bit_flip: Share = 0.0
    """One bit of it is turned over."""
    delay_s: NonNegative = 0.0
    """Every message is late by this [s] ..."""
    delay_jitter_s: NonNegative = 0.0
    """... and by a random time beyond, exponential with this mean [s]."""
    pause_s: Positive = 0.02
    """Pause within a split message [s]."""
