"""Colour ranges measured from boxes and clicks on pictures of known colour."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.doctor.colors import Box, hsv_of, in_range, measure_range, overlapping, patches
from schemas.robot import HsvRange


def picture(hue: float, *, sd: float = 3.0, value: float = 200.0) -> np.ndarray:
    """A grey floor with noise, and a disc of radius 12 px about (60, 40) in one hue, shaded towards its rim; RGB."""
    rng = np.random.default_rng(0)
    hsv = np.zeros((80, 120, 3), dtype=np.uint8)
    hsv[..., 2] = 120
    v, u = np.mgrid[:80, :120] + 0.5
    off = np.hypot(u - 60, v - 40)
    disc = off < 12
    hsv[disc, 0], hsv[disc, 1] = round(hue) % 180, 210
    hsv[disc, 2] = value * (1 - 0.5 * (off[disc] / 12) ** 2)
    rgb = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB).astype(float)
    return np.clip(rgb + sd * rng.standard_normal(rgb.shape), 0, 255).astype(np.uint8)


DISC = np.hypot(*(np.mgrid[:80, :120] + 0.5 - np.array([40, 60])[:, None, None])) < 11.5


@pytest.mark.parametrize("hue", [2.0, 30.0, 69.0, 112.0, 178.0])
@pytest.mark.parametrize("box", [Box("r", 40, 20, 80, 60), Box.clicked("r", 60, 40)], ids=["box", "click"])
def test_the_measured_range_holds_the_cap_and_not_the_floor(hue: float, box: Box) -> None:
    """From one mark, round red too: 97 % of the disc, nothing of the floor, and a narrow range about the hue."""
    hsv = hsv_of(picture(hue))
    found = measure_range([hsv], [box], "r")
    mask = in_range(hsv, found)
    assert mask[DISC].mean() > 0.97
    assert mask[~DISC].sum() <= 120  # the rim of the disc
    low, high = found.hue
    assert 12 <= (high - low) % 180 <= 24
    assert (hue - low) % 180 < (high - low) % 180


def test_a_mark_without_colour_is_refused() -> None:
    """A click on the floor says so, with its place, even beside a good one."""
    hsv = hsv_of(picture(69.0))
    with pytest.raises(InputError, match="no colour") as caught:
        measure_range([hsv], [Box.clicked("green", 60, 40), Box.clicked("green", 20, 20)], "green")
    assert "u 15 .. 26, v 15 .. 26" in caught.value.where


@pytest.mark.parametrize("at", [(119, 79), (500, 500), (0, 0)])
def test_marks_at_and_beyond_the_edge_are_no_crash(at: tuple[int, int]) -> None:
    """A click outside of the picture is refused like one without colour."""
    with pytest.raises(InputError):
        measure_range([hsv_of(picture(69.0))], [Box.clicked("green", *at)], "green")


def test_overlap_of_hues_is_found_round_red() -> None:
    """Ranges that share a hue are named, also across 0."""

    def made(rod: str, low: float, high: float) -> HsvRange:
        return HsvRange(rod=rod, hue=(low, high), saturation_min=100.0, value_min=30.0)

    assert overlapping([made("a", 170, 5), made("b", 3, 20), made("c", 60, 80)]) == [("a", "b")]
    assert overlapping([made("a", 165, 180), made("b", 60, 78), made("c", 103, 120)]) == []


def test_patches_count_what_is_large_enough() -> None:
    """Two blocks of 3 x 3 count, a speck of 2 x 2 does not."""
    mask = np.zeros((20, 20), dtype=bool)
    mask[2:5, 2:5] = mask[10:13, 2:5] = mask[15:17, 15:17] = True
    assert patches(mask) == 2
