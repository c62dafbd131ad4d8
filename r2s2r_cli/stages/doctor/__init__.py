"""What `doctor` works out from a few frames of a camera: the ground, the colours, the pace."""
