"""The rig's RGB-D camera: what it sees (`scene`, `render`), how badly (`depth_noise`, `color_noise`), when (`clock`),
and the service that hosts read it from (`service`)."""
