"""A page to mark caps on: clicks and boxes on the picture become options of `doctor camera`. Needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from importlib import resources

import numpy as np


def marks_page(color: np.ndarray, rods: Sequence[str], *, command: str, preview: bytes, title: str) -> bytes:
    """UTF-8 HTML. color: RGB (v, u, 3); command: what the options are appended to; preview: PNG shown below."""
    import cv2
    from jinja2 import Environment, StrictUndefined

    _, encoded = cv2.imencode(".png", color[..., ::-1])
    task = {"picture": _base64(encoded.tobytes()), "command": command}
    # Inside a script element `</` would end it, whatever it stands in.
    safe = json.dumps(task).replace("<", "\\u003c")
    folder = resources.files("r2s2r_cli").joinpath("views", "templates")
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(
        folder.joinpath("marks.html").read_text(encoding="utf-8")
    )
    return template.render(
        title=title, rods=rods, width=color.shape[1], height=color.shape[0], preview=_base64(preview),
        task=safe, script=folder.joinpath("marks.js").read_text(encoding="utf-8"),
    ).encode()  # fmt: skip


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
