"""`plan`: symmetries of a robot, gaits found in the simulator, long policies made of them."""
