"""The maker of blind sets: the only part of `blind` that imports the rig. `python -m r2s2r_cli.blind.make`."""
