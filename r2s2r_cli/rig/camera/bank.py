"""Noise ready to use: a large field made once, of which every picture takes another window."""

from __future__ import annotations

import numpy as np

SPARE_PX = 256
"""The field is larger than the picture by this, so there are 257^2 windows, each with either sign."""


class Bank:
    """Gaussian noise of mean 0 and variance 1; two pictures share no window but by a chance of 1 in 66049.

    Drawing new numbers for each pixel of each picture would cost more than everything else the camera does.
    """

    def __init__(self, rng: np.random.Generator, height: int, width: int, correlation_px: float = 0.0) -> None:
        """correlation_px: distance at which the correlation has fallen to 1/e; 0: white."""
        shape = (height + SPARE_PX, width + SPARE_PX)
        self._shape = (height, width)
        self.field = smooth(rng.standard_normal(shape), correlation_px).astype(np.float32)

    def window(self, rng: np.random.Generator) -> np.ndarray:
        """A picture's share, (v, u); a view into the field."""
        v, u = rng.integers(0, SPARE_PX, size=2, endpoint=True)
        return self.field[v : v + self._shape[0], u : u + self._shape[1]]


def smooth(white: np.ndarray, correlation_px: float) -> np.ndarray:
    """White noise of variance 1 with a Gaussian correlation exp(-(d / correlation_px)^2), variance 1 again.

    A Gaussian filter of width s gives the correlation exp(-d^2 / (4 s^2)). Wraps round at the edges.
    """
    if correlation_px <= 0:
        return white
    s = correlation_px / 2
    transfer = [np.exp(-2 * (np.pi * s * np.fft.fftfreq(n)) ** 2) for n in white.shape]
    gain = np.outer(*transfer)
    filtered = np.fft.ifft2(np.fft.fft2(white) * gain).real
    return np.asarray(filtered / np.sqrt((gain**2).mean()))
