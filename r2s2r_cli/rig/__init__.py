"""The rig: a virtual robot whose physics is foreign to the engine.

It shares `robot.toml` and its schema with the engine and nothing else, so that a gap between the two means something.
"""
