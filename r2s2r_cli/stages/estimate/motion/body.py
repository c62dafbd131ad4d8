"""The robot as the back end sees it, and the layout of the state vector of one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.robot import Robot

ACROSS = 2
"""Parts of the error that neighbouring sightings of a cap share: across the line of sight."""


@dataclass(frozen=True)
class Body:
    """Index arrays and lengths. A state is p (cap x 3), v (cap x 3), sensor offsets and, where `sharing`, ACROSS shared
    errors of the sightings of each cap."""

    rod: np.ndarray
    """Caps of each rod, shape (rod, 2)."""
    rod_length: np.ndarray
    rod_diameter: np.ndarray
    radius: np.ndarray
    """Of each cap [m], shape (cap,)."""
    cable: np.ndarray
    """Caps of each cable, shape (cable, 2)."""
    sensor: np.ndarray
    """Caps whose distance each sensor shows, shape (sensor, 2)."""
    sharing: bool

    @classmethod
    def of(cls, robot: Robot, cable_of_sensor: np.ndarray | None = None, *, sharing: bool = False) -> Body:
        """Of a robot; cable_of_sensor: cable of each sensor, default those of robot.toml."""
        cable = np.array([one.caps for one in robot.cables], dtype=int)
        if cable_of_sensor is None:
            cable_of_sensor = np.array([sensor.cable for sensor in robot.sensors], dtype=int)
        return cls(
            rod=np.arange(robot.n_caps).reshape(-1, 2),
            rod_length=np.array([rod.length_m for rod in robot.rods]),
            rod_diameter=np.array([2 * rod.radius_m for rod in robot.rods]),
            radius=np.repeat([rod.cap_radius_m for rod in robot.rods], 2),
            cable=cable,
            sensor=cable[np.asarray(cable_of_sensor, dtype=int)].reshape(-1, 2),
            sharing=sharing,
        )

    @property
    def caps(self) -> int:
        """Number of end caps."""
        return len(self.radius)

    @property
    def moving(self) -> int:
        """States that are positions or velocities; they come first."""
        return 6 * self.caps

    @property
    def dim(self) -> int:
        """States of one frame."""
        return self.moving + len(self.sensor) + (ACROSS * self.caps if self.sharing else 0)

    @property
    def bias(self) -> slice:
        """Offsets of the sensors [m]."""
        return slice(self.moving, self.moving + len(self.sensor))

    def p(self, cap: int) -> np.ndarray:
        """States of a cap's position."""
        return 3 * cap + np.arange(3)

    def v(self, cap: int) -> np.ndarray:
        """States of a cap's velocity."""
        return 3 * (self.caps + cap) + np.arange(3)

    def shared(self, cap: int) -> np.ndarray:
        """States of the shared errors of a cap's sightings, in standard deviations; none where not `sharing`."""
        return self.bias.stop + ACROSS * cap + np.arange(ACROSS if self.sharing else 0)

    def positions(self, x: np.ndarray) -> np.ndarray:
        """Caps of states, shape (..., dim) to (..., cap, 3)."""
        return x[..., : 3 * self.caps].reshape(*x.shape[:-1], self.caps, 3)

    def velocities(self, x: np.ndarray) -> np.ndarray:
        """The same of velocities."""
        return x[..., 3 * self.caps : self.moving].reshape(*x.shape[:-1], self.caps, 3)
