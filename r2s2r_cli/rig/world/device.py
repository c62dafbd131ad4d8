"""The tables of a world file that describe the boards: sensors, motors, inertial units, clocks."""

from __future__ import annotations

from typing import Literal

from r2s2r_cli.rig.section import Count, NonNegative, Positive, Real, Section, Share, Size, Spread


class Sensors(Section):
    """The capacitive stretch sensors. Lengths are distances of cap centres, as `robot.toml` calibrates them.

    C = slope (length + day + drift + bow) + offset, followed by lag, noise and the converter.
    """

    line: Literal["robot.toml", "own"] = "robot.toml"
    """Which line a calibrated sensor follows: that of `robot.toml`, so that any calibrated robot can be simulated; or
    its own, below, whatever the host believes: then a calibration with `r2s2r rig --points` has errors of its own."""
    slope_f_per_m: Positive = 3e-11
    """Of a sensor that has no calibration [F/m]; 3e-11 is 0.03 pF/mm."""
    offset_f: Positive = 1.4e-11
    """The same: capacitance at length 0 [F]."""
    day_sd_m: Size = 0.005
    """Offset of today against the calibration, drawn once a sensor from the seed [m], standard deviation."""
    drift_sd_m: Size = 0.001
    """Slow drift: a random walk with this standard deviation after a minute, growing with the root of time [m]."""
    bow_sd_m: Size = 0.002
    """Quadratic error: largest deviation from the calibrated line within the controller's range (passive cables:
    within 5 cm of their length at rest), beyond it constant; drawn once a sensor [m], standard deviation."""
    noise_sd_m: Size = 0.0005
    """White, every sample [m], standard deviation."""
    lag_s: NonNegative = 0.03
    """Time constant of the first-order lag [s]."""
    converter: Literal["10 bit", "exact"] = "10 bit"
    """`10 bit`: C = 42 1024 / 3.3 / n pF with n whole, as on the robot; one count is 0.031 pF at 20 pF."""
    dropout_share: Share = 0.002
    """Samples in which a sensor repeats its last value."""


class Inertial(Section):
    """The inertial unit of every board, in the rod's axes R, at the rod's middle."""

    accel_bias_sd_m_per_s2: NonNegative = 0.4
    """Drawn once an axis from the seed, standard deviation."""
    accel_noise_sd_m_per_s2: NonNegative = 0.02
    """White, every sample."""
    gyro_bias_sd_rad_per_s: NonNegative = 0.017
    """Drawn once an axis from the seed."""
    gyro_noise_sd_rad_per_s: NonNegative = 0.002
    """White, every sample."""
    yaw_drift_rad_per_s: Real = 3.5e-4
    """Of the attitude that the older boards send: nothing holds its heading."""


class Boards(Section):
    """The microcontrollers. Each has a clock, a phase and a rate of its own."""

    layout: Literal["per_rod", "central"] = "per_rod"
    """`per_rod`: three boards with three sensors and two motors each, as on the newer robot (other robots: one board a
    rod, everything dealt out in turn). `central`: one board with everything, as on the older robot."""
    rate_hz: Positive = 50.0
    """Samples of a board a second [Hz]; it drives its motors at once when a command comes."""
    rate_spread: Spread = 0.01
    """Boards differ in rate by this part (standard deviation, drawn from the seed)."""
    jitter_s: NonNegative = 0.001
    """Of every sample's instant [s], standard deviation."""
    clock_spread_s: NonNegative = 100.0
    """Boards were switched on at different times: their clocks show 0 to this much at the rig's time 0 [s]."""
    clock_drift: NonNegative = 3e-5
    """Part of time by which their clocks run wrong, standard deviation."""
    pwm_steps: Count = 255
    """Of the motor drivers at full command; a command is cut down to a whole step."""
    encoder_counts: Positive = 1800.0
    """Counts of an encoder a turn of its winch: 12 times 150 of the gear."""
    supply_v: Positive = 7.4
    """Of the full battery at rest [V]."""
