"""What is on the robot's boards: capacitive sensors, inertial units, encoders, PWM, and clocks that do not agree.

`Firmware` is the seam to the wire: duties in, samples out. What a protocol adds (watchdog, latch,
acknowledgement) is the business of `rig/wire`.
"""

from r2s2r_cli.rig.firmware.bench import points_csv as points_csv
from r2s2r_cli.rig.firmware.firmware import Firmware as Firmware
from r2s2r_cli.rig.firmware.sample import BoardSample as BoardSample
from r2s2r_cli.rig.firmware.sensors import nominal_calibration as nominal_calibration
