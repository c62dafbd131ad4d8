"""`record`: policies on the robot, every raw sample, command and picture into a journal."""
