"""A table that a recording was cut off in: fewer rows than the readings that it explains have columns."""

from __future__ import annotations

from collections.abc import Mapping

from r2s2r_cli.artifact import Blobs, Group
from schemas.base import ArtifactSpec, GroupSpec


def without_torn_tables(groups: Mapping[str, Group], spec: ArtifactSpec) -> dict[str, Group]:
    """The groups less every optional dataset whose rows are an axis of another one of its group, but not as many.

    `sensors/cable` is such a one: a row a sensor. Half of it says of no sensor which cable it measures, and must not
    keep the readings from being sealed.
    """
    found = {}
    for path, group in groups.items():
        layout = spec.group(path)
        torn = [] if layout is None else _torn(group, layout)
        found[path] = Group({k: v for k, v in group.datasets.items() if k not in torn}, group.attributes)
    return found


def _torn(group: Group, layout: GroupSpec) -> list[str]:
    columns = {name: found for name in group.datasets if (found := layout.dataset(name)) is not None}
    axes = {
        axis: size
        for name, column in columns.items()
        if not isinstance(value := group.datasets[name], Blobs)
        for axis, size in zip(column.dims[1:], value.shape[1:], strict=False)
    }
    return [
        name
        for name, column in columns.items()
        if not column.required and not isinstance(value := group.datasets[name], Blobs)
        and value.shape[0] != axes.get(column.dims[0], value.shape[0])
    ]  # fmt: skip
