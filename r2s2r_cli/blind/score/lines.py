"""JSON that is short and can still be read: what fits stands on one line."""

from __future__ import annotations

import json
from typing import Any

WIDTH = 320


def text_of(value: Any) -> str:
    """The text with a line feed at its end, keys sorted; the same for equal values. Raises ValueError for NaN."""
    return _text(value, 0, 0) + "\n"


def _text(value: Any, depth: int, taken: int) -> str:
    """taken: characters of the line before it."""
    short = json.dumps(value, sort_keys=True, ensure_ascii=False, allow_nan=False)
    if not isinstance(value, dict | list | tuple) or not value or depth + taken + len(short) <= WIDTH:
        return short
    pad = "\n" + " " * (depth + 1)
    if isinstance(value, dict):
        named = [(json.dumps(name, ensure_ascii=False) + ": ", value[name]) for name in sorted(value)]
        parts = [name + _text(inner, depth + 1, len(name)) for name, inner in named]
        return "{" + pad + ("," + pad).join(parts) + "\n" + " " * depth + "}"
    parts = [_text(inner, depth + 1, 0) for inner in value]
    return "[" + pad + ("," + pad).join(parts) + "\n" + " " * depth + "]"
