"""What goes into the motion back end and what comes out of it: plain arrays, world frame W, SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SEEN, HIDDEN, REJECTED = 0, 1, 2
"""Codes of `TrackedRun.quality`: sighted and used; not sighted, predicted; sighted, contradicts the rest, not used."""

NO_SENSORS, PARTLY_HIDDEN, BLIND, LOST, NO_IMAGE = 1, 2, 4, 8, 16
"""Bits of `TrackedRun.mode`: no usable cable sensor near the frame; some caps were not sighted; no cap was sighted;
some cap is less certain than `MotionSettings.lost_sd_m`; there was no image (the state bridges a gap)."""


@dataclass(frozen=True)
class MotionSettings:
    """Settings of the back end; standard deviations unless stated otherwise."""

    rod_sd_m: float = 1e-4
    """Of the rod lengths of robot.toml."""
    acceleration: float = 0.03
    """Spectral density of the white acceleration to start from [m^2/s^3]; `smooth_run` estimates it over each run."""
    kick_m_per_s: float = 0.02
    """Change of a cap's velocity, per axis, where a motor is switched."""
    sensor_bias_sd_m: float = 0.008
    """Of the offset of a cable sensor at the start of a run: the real ones move by 5 mm and more from day to day."""
    sensor_walk_m: float = 5e-4
    """Of the change of that offset over 1 s: drift, and what is not linear in the sensor."""
    sensor_noise_sd_m: float = 0.003
    """Of one sample, to start from; estimated over the run."""
    clock_range_s: float = 0.5
    """Clock offset and lag together are searched for up to that much, either way."""
    ground_sd_m: float = 0.0002
    """Of the plane z = 0 against the floor under the caps; it is not estimated again from the contacts, because a plane
    through a hundred thousand points is better known than the heights of a few caps."""
    ground_tilt_sd_rad: float = 0.001
    """Of its slopes."""
    contact_sd_m: float = 3e-4
    """Of the height of a cap that carries weight: floors and caps give way a little."""
    slip_sd_m_per_s: float = 0.03
    """Of the horizontal speed of a cap that carries weight: it rolls, and slides at times."""
    lost_sd_m: float = 0.03
    """A cap less certain than this along its worst axis counts as lost."""


@dataclass(frozen=True)
class Sighted:
    """Sightings of a run, one row a frame (also frames in which nothing was seen)."""

    t: np.ndarray
    """Stamps [s], increasing, shape (frame,)."""
    p_WE: np.ndarray
    """Centres of the caps [m], shape (frame, cap, 3); NaN where a cap was not sighted."""
    cov: np.ndarray
    """Their covariance [m^2], shape (frame, cap, 3, 3); anything where there is no sighting."""


@dataclass(frozen=True)
class Readings:
    """Lengths that the cable sensors gave, each at its own stamp."""

    t: np.ndarray
    """Stamps of the robot's clock as the host knows it [s], shape (sample,); rows need not be ordered."""
    length: np.ndarray
    """[m], shape (sample, sensor); NaN where a sensor is not in the row."""
    cable: np.ndarray
    """Cable of each sensor, shape (sensor,)."""


@dataclass(frozen=True)
class SensorClock:
    """By how much the sensors show lengths later than the camera: clock offset and lag together."""

    delay_s: float
    """A length that the sensors show at stamp t was seen by the camera at t - delay_s; 0 where it is not known."""
    sd_s: float
    known: bool
    """False: nothing moved enough to tell, or there are no sensors."""


@dataclass(frozen=True)
class TrackedRun:
    """The smoothed run. Row k is row k of `Sighted`."""

    t: np.ndarray
    p_WE: np.ndarray
    """[m], shape (frame, cap, 3)."""
    cov_p: np.ndarray
    """[m^2], shape (frame, cap, 3, 3)."""
    v_WE: np.ndarray
    """[m/s], shape (frame, cap, 3)."""
    cov_v: np.ndarray
    """[m^2/s^2], shape (frame, cap, 3, 3)."""
    length: np.ndarray
    """Distance of the cap centres of each cable [m], shape (frame, cable)."""
    length_sd: np.ndarray
    """From the joint covariance [m], shape (frame, cable)."""
    sensor_bias: np.ndarray
    """Shown minus true length [m], shape (frame, sensor)."""
    sensor_bias_sd: np.ndarray
    """[m], shape (frame, sensor)."""
    sensor_noise_sd: np.ndarray
    """Of one sample, as the run shows it [m], shape (sensor,)."""
    sensor_dead: np.ndarray
    """Sensors that contradict everything else, or never speak, shape (sensor,)."""
    clock: SensorClock
    ground: np.ndarray
    """Height at x = y = 0 [m] and slopes dz/dx, dz/dy of the floor that the states stand on, shape (3,): 0."""
    ground_sd: np.ndarray
    contact: np.ndarray
    """Caps that carry weight, bool, shape (frame, cap)."""
    contact_probability: np.ndarray
    """Shape (frame, cap)."""
    quality: np.ndarray
    """SEEN, HIDDEN, REJECTED; uint8, shape (frame, cap)."""
    mode: np.ndarray
    """Bits NO_SENSORS, PARTLY_HIDDEN, BLIND, LOST, NO_IMAGE; uint8, shape (frame,)."""
    score: np.ndarray
    """Distance of each sighting from the smoothed state over the standard deviation of that distance, root mean square
    over axes, shape (frame, cap); NaN where there is none."""
    noise_scale: np.ndarray
    """What the standard deviations of the sightings were multiplied by, across and along the line of sight, because the
    run shows it, shape (2,)."""
    acceleration: np.ndarray
    """Spectral density of the acceleration that was used [m^2/s^3], shape (frame - 1, cap)."""
    rounds: int
    """Gauss-Newton steps, all together."""
    settled: bool
    """The last step moved no cap by more than 0.1 mm."""
