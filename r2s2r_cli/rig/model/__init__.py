"""The robot as a MuJoCo model, written from `robot.toml` by code of its own.

`mjcf` needs no MuJoCo. `MujocoSim` and `build` do (extra `rig`) and are imported from `r2s2r_cli.rig.model.sim`.
"""

from r2s2r_cli.rig.model.bodies import Body as Body, body_of as body_of
from r2s2r_cli.rig.model.frames import Pose as Pose, rest_pose as rest_pose
from r2s2r_cli.rig.model.mjcf_text import mjcf as mjcf
from r2s2r_cli.rig.model.options import STIFF as STIFF, Options as Options
