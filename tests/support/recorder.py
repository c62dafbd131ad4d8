"""A recording in progress: the journal of a run with two rates of rows and images."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2s2r_cli.store.journal import Field, Journal, JournalHead, Stream
from schemas.versions import KINDS
from tests.support.builders import png, provenance

RUN = "runs/walk"
SENSORS, COLOR, DEPTH = f"{RUN}/sensors", f"{RUN}/camera:color", f"{RUN}/camera:depth"


def head(**changes: object) -> JournalHead:
    """Sensors at one rate; colour and depth images, two streams of one group, at others."""
    camera = {"width": 4, "height": 4}
    streams = (
        Stream(SENSORS, (Field("t", "float64"), Field("capacitance", "float64", (2,))), {}),
        Stream(f"{RUN}/camera", (Field("t", "float64"), Field("color", "blobs")), camera, "color"),
        Stream(f"{RUN}/camera", (Field("t_depth", "float64"), Field("depth", "blobs")), camera, "depth"),
    )
    run = {"origin": "robot", "nature": "measured", "source": "a test", "robot": "threebar"}
    version = KINDS["recording"].version
    made = provenance(stage="record", **changes).model_dump(mode="json")
    return JournalHead("recording", version, streams, {RUN: run}, made)


def sensor_row(number: int) -> dict[str, np.ndarray | float]:
    """The row with this number; its values tell the number."""
    return {"t": 0.01 * number, "capacitance": np.array([number, -number], dtype=float)}


def image(number: int) -> bytes:
    """The image with this number; its length and pixels tell the number."""
    return png(number % 251) + bytes(number % 7)


def append(journal: Journal, number: int) -> int:
    """Append sensor row `number`, and every third time a colour, every fifth a depth image. Rows written."""
    journal.append(SENSORS, sensor_row(number))
    rows = 1
    if number % 3 == 0:
        journal.append(COLOR, {"t": 0.01 * number, "color": image(number)})
        rows += 1
    if number % 5 == 0:
        journal.append(DEPTH, {"t_depth": 0.01 * number, "depth": image(number + 1)})
        rows += 1
    return rows


def write(path: Path, rows: int, **changes: object) -> int:
    """A closed journal with `rows` sensor rows. Rows of all streams."""
    with Journal(path, head(**changes)) as journal:
        return sum(append(journal, number) for number in range(rows))


def counts(rows: int) -> dict[str, int]:
    """Rows by stream after `rows` sensor rows."""
    every = {SENSORS: 1, COLOR: 3, DEPTH: 5}
    return {key: -(-rows // step) for key, step in every.items() if rows}
