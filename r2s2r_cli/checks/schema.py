"""Do the values have the form that the schema fixes? Physics is checked only where they have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.artifact import Blobs
from r2s2r_cli.checks.base import AGAIN, Found, check, worst
from r2s2r_cli.checks.subjects import Content
from schemas.base import DatasetSpec

_IMAGE_STARTS = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")


@check(
    "error",
    Content,
    what="every group, dataset and attribute is one of the schema, with its dtype, axes, unit and frame",
    why="a reader that trusts the schema would read another quantity, unit or axis",
    fix=f"{AGAIN}   # schemas/LAYOUT.md has the layout of every kind",
)
def layout_matches(content: Content) -> Iterator[Found]:
    """What the layout check of the store said."""
    for place in content.layout:
        yield Found(place.where.lstrip("/"), place.what, place.expected, place.received)


@check(
    "error",
    Content,
    what="no infinity, and NaN only where the schema says what NaN means",
    why="one silent NaN spreads through every mean, fit and plot after it",
    fix=f"{AGAIN}   # first look at the named place in what it was made from",
)
def values_finite(content: Content) -> Iterator[Found]:
    """Infinity anywhere, NaN where it has no meaning."""
    for location, spec, values in _arrays(content):
        if values.dtype.kind != "f":
            continue
        bad = np.isinf(values) if spec.nan_means else ~np.isfinite(values)
        if bad.any():
            expected = f"finite, or NaN for '{spec.nan_means}'" if spec.nan_means else "finite numbers"
            yield Found(location, "a value is not finite", expected, worst(values, bad.astype(float), spec.dims))


@check(
    "error",
    Content,
    what="every code is one that the schema explains",
    why="an unknown code has no meaning, or comes from a newer version",
    fix="r2s2r inspect {file}",
)
def codes_known(content: Content) -> Iterator[Found]:
    """Values of unit `code` without a meaning."""
    for location, spec, values in _arrays(content):
        if spec.codes:
            bad = ~np.isin(values, list(spec.codes))
            if bad.any():
                known = ", ".join(f"{code} {words.partition(':')[0]}" for code, words in spec.codes.items())
                yield Found(location, "a code has no meaning", known, worst(values, bad.astype(float), spec.dims))


@check(
    "error",
    Content,
    what="text datasets hold UTF-8",
    why="names of sets, curves and files are shown and compared as text",
    fix=f"{AGAIN}   # first write the names in what it was made from as UTF-8",
)
def text_readable(content: Content) -> Iterator[Found]:
    """Bytes that are not UTF-8."""
    for location, _, values in _arrays(content):
        if values.dtype.kind != "S":
            continue
        for row, item in enumerate(values.ravel().tolist()):
            try:
                item.decode("utf-8")
            except UnicodeDecodeError as error:
                yield Found(location, "a text is not UTF-8", "UTF-8", f"{item[:20]!r} in row {row}: {error.reason}")
                break


@check(
    "error",
    Content,
    what="every stored image begins as a PNG or JPEG does",
    why="an empty or torn image stops `estimate` in the middle of a run",
    fix=f"{AGAIN}   # first leave out in the source the frames whose image is broken",
)
def images_begin_right(content: Content) -> Iterator[Found]:
    """Encoded frames that no decoder will take."""
    for path, group in content.data.groups.items():
        for name, value in group.datasets.items():
            if not isinstance(value, Blobs):
                continue
            bad = [(i, item[:8]) for i, item in enumerate(value.items) if not item.startswith(_IMAGE_STARTS)]
            if bad:
                more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
                first = f"{bad[0][1]!r}" if bad[0][1] else "an empty one"
                yield Found(f"{path}/{name}", "an image is neither PNG nor JPEG", "PNG or JPEG",
                            f"{first} at frame {bad[0][0]}{more}")  # fmt: skip


def _arrays(content: Content) -> Iterator[tuple[str, DatasetSpec, np.ndarray]]:
    """(location, specification, values) of every array that has the right number of axes."""
    for path, group in content.data.groups.items():
        spec = content.spec.group(path)
        for name, value in group.datasets.items():
            dataset = spec.dataset(name) if spec else None
            if dataset is not None and isinstance(value, np.ndarray) and value.ndim == len(dataset.dims):
                yield f"{path}/{name}", dataset, value


FORM = (layout_matches, values_finite, codes_known, text_readable)
"""Values that do not pass these are looked at by no other check: it could not trust their shape."""
