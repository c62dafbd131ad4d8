"""The camera tracker's eyes: ground, camera pose, colours, and where each cap is seen in a frame, with covariance."""
