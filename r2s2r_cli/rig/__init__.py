"""The rig: a virtual robot whose physics is foreign to the engine.

It shares `robot.toml` and its schema with the engine and nothing else, so that a gap between the two means something.
"""

import os

# MuJoCo only simulates here; the rig's camera draws for itself. What opens windows takes MuJoCo 0.1 s to load.
os.environ.setdefault("MUJOCO_GL", "disable")
