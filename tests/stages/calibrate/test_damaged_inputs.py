"""Damaged texts of every kind: an error with place and hint, or finite numbers; never a traceback or a warning."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
import pytest

from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.stages.calibrate import Source, calibrate
from schemas.calibration import CALIBRATION
from schemas.robot import Robot
from tests.stages.calibrate.conftest import cubic_text

PIECES = (
    b"",
    b"-",
    b"e999",
    b"nan",
    b"1e-320",
    b"9" * 400,
    b",",
    b'"',
    b"\n",
    b"\x00",
    b"\xff",
    b"[",
    b"]",
    b"{",
    b"#",
    b"0",
    b".",
)
KINDS = ("points", "history", "tendons", "masses")
SEEDS = 150


def damaged(data: bytes, dice: random.Random) -> bytes:
    """Exchanged digits; or a few cuts, insertions, exchanges or doublings at random places."""
    if dice.random() < 0.5:
        digits = [i for i, byte in enumerate(data) if chr(byte).isdigit()]
        for at in dice.sample(digits, dice.randint(1, 6)):
            data = data[:at] + dice.choice((b"0", b"1", b"5", b"9", b"e")) + data[at + 1 :]
        return data
    for _ in range(dice.randint(1, 3)):
        at, length = dice.randrange(len(data) + 1), dice.choice((0, 1, 1, 3, 20))
        piece = dice.choice((*PIECES, data[at : at + 30], bytes([dice.randrange(256)])))
        data = data[:at] + piece + data[at + length :]
    return data


@pytest.mark.parametrize("kind", KINDS)
def test_damage_is_an_error_or_changes_a_number(robot: Robot, points_text: Callable[..., str], kind: str) -> None:
    """150 random damages a kind: R2S2RError that says where and what to do, or an artifact without stray NaN."""
    parts = '[[part]]\nname = "a{0}"\nmass_kg = 0.06\noffset_m = 0.01\nshape = "sphere"\nradius_m = 0.02\n'
    history = ",\n".join(
        f'{{"file": "f", "date": "2025-01-0{day}", "m_pF_per_mm": {[0.03] * 9}, "b_pF": {[16 + day / 9] * 9}}}'
        for day in (1, 2, 3, 4)
    )
    text = {
        "points": points_text(),
        "history": f"[{history}]",
        "tendons": cubic_text(np.array([[80.0, -300.0, 4000.0], [90.0, 0.0, 0.0]])),
        "masses": parts.format(1) + parts.format(2),
    }[kind]
    refused = 0
    for seed in range(SEEDS):
        source = Source("input", damaged(text.encode(), random.Random(seed)))
        try:
            data, report = calibrate(robot=robot, **{kind: [source] if kind == "tendons" else source})  # type: ignore[arg-type]
        except R2S2RError as error:
            refused += 1
            assert error.where and error.hint and error.expected
            continue
        report.model_dump_json()
        for path, group in data.groups.items():
            for dataset in getattr(CALIBRATION.group(path), "datasets", ()):
                array = group[dataset.path]
                assert array.dtype.kind != "f" or dataset.nan_means or np.isfinite(array).all(), (seed, dataset.path)
    assert refused > SEEDS / 4
