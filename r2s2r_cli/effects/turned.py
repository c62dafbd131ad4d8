"""How dry friction turns round: the memory that the effects of cables share."""

from __future__ import annotations

import torch
from torch import Tensor


def turned(z: Tensor, u: Tensor) -> Tensor:
    """The friction z, a share of its largest, -1 to 1, after a motion of u times the length over which it builds up.

    Bouc and Wen's law with n = 2 and equal shares: dz = du against z, dz = (1 - z^2) du with it. Integrated exactly:
    many small motions one way are one large motion, and no motion leads beyond 1.
    """
    way = torch.where(u < 0, -torch.ones_like(u), torch.ones_like(u))
    ahead, far = way * z, way * u
    # First in a line back to the middle, then as tanh; clamp, not relu: at rest the derivatives are those of motion.
    build = torch.tanh(torch.clamp(far - torch.relu(-ahead), min=0.0))
    built = torch.clamp(ahead, min=0.0)
    return way * ((built + build) / (1.0 + built * build) - torch.relu(-ahead - far))
