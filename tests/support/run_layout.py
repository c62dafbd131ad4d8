"""Compare the groups of one run with the layout that `schemas` fixes, without a file between them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from r2s2r_cli.artifact import Blobs, Group
from schemas.base import DIM_SIZES
from schemas.recording import RECORDING

_TYPES = {"str": str, "int": int, "float": float, "bool": bool}


def assert_run_layout(groups: Mapping[str, Group]) -> None:
    """Every group, dataset and attribute of a run is described, of its type and shape, and nothing required is missing.

    An axis has one length within a group, and `actuated`, `cap`, `rod` one within the run; NaN stands only where
    the layout says what it means.
    """
    run_axes: dict[str, int] = {}
    for stream, group in groups.items():
        spec = RECORDING.group(f"runs/log/{stream}".rstrip("/"))
        assert spec is not None, stream
        assert {d.path for d in spec.datasets if d.required} <= set(group.datasets), stream
        assert {a.name for a in spec.attributes if a.required} <= set(group.attributes), stream
        axes: dict[str, int] = dict(DIM_SIZES)
        for name, value in group.datasets.items():
            dataset = spec.dataset(name)
            assert dataset is not None, f"{stream}/{name}"
            if isinstance(value, Blobs):
                assert dataset.dtype == "blobs"
                assert axes.setdefault(dataset.dims[0], value.count) == value.count, f"{stream}/{name}"
                continue
            array = group[name]
            assert str(array.dtype) == dataset.dtype, f"{stream}/{name}"
            assert array.ndim == len(dataset.dims), f"{stream}/{name}"
            for dim, size in zip(dataset.dims, array.shape, strict=True):
                shared = run_axes if dim in ("actuated", "cap", "rod") else axes
                assert shared.setdefault(dim, size) == size, f"{stream}/{name}: {dim}"
            assert dataset.nan_means or np.isfinite(array).all(), f"{stream}/{name}"
        for name, value in group.attributes.items():
            attribute = next((a for a in spec.attributes if a.name == name), None)
            assert attribute is not None, f"{stream}@{name}"
            assert isinstance(value, _TYPES[attribute.type]), f"{stream}@{name}"
            assert not attribute.choices or value in attribute.choices, f"{stream}@{name}"
