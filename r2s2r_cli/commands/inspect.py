"""`r2s2r inspect`: what is in a file: header, tree, units; or whether two artifacts hold the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import GateError, quoted
from r2s2r_cli.options import JsonOption, QuietOption
from r2s2r_cli.store.again import command_at
from r2s2r_cli.store.header import HDF5_SIGNATURE, NotAnArtifact
from r2s2r_cli.store.imported import look_at
from schemas.header import Header
from schemas.results import InspectResult, NodeInfo

if TYPE_CHECKING:
    from schemas.base import ArtifactSpec


def inspect(
    path: Annotated[Path, typer.Argument(help="An artifact, or an HDF5 file of another program.")],
    same_as: Annotated[
        Path | None, typer.Option("--same-as", metavar="FILE", help="Exit 0 if both hold the same content, else 3.")
    ] = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Show the header and the tree of a file: every dataset with shape, unit, frame and meaning.

    Example: r2s2r inspect iterations/001/20-estimate.h5
    """
    console = Console(json=json, quiet=quiet)
    if same_as is not None:
        _compare(path, same_as, console)
        return
    result = _describe(path)
    console.document(result)
    _show(result, console)


def _describe(path: Path) -> InspectResult:
    from r2s2r_cli.store.read import checked_header, describe

    try:
        header = checked_header(path)
    except NotAnArtifact:
        if not path.is_file() or _ours(path):
            raise
        return _foreign(path)
    return InspectResult(path=str(path), header=header.model_dump(mode="json"), nodes=tuple(describe(path)))


def _ours(path: Path) -> bool:
    """Whether the file begins as ours do: then its head is damaged, and it is no file of another program."""
    from r2s2r_cli.store.header import NAME

    with path.open("rb") as file:
        return file.read(len(NAME)) == NAME


def _foreign(path: Path) -> InspectResult:
    """The tree of an HDF5 file that is not ours, read in the child process."""
    from r2s2r_cli.errors import ArtifactError
    from r2s2r_cli.store.isolated import IsolatedReader
    from r2s2r_cli.store.verify import find_body

    with path.open("rb") as file:
        is_hdf5 = file.read(8) == HDF5_SIGNATURE
    if not is_hdf5 and find_body(path) is None:
        raise ArtifactError(
            "this is neither an artifact nor an HDF5 file",
            where=str(path),
            expected="an artifact of r2s2r",
            received="something else" if path.stat().st_size else "an empty file",
            hint=command_at(path) or look_at(path),
        )
    with IsolatedReader() as reader:
        report = reader.tree(path)
    if report["problem"]:
        raise ArtifactError(report["problem"], where=str(path), expected="an intact HDF5 file",
                            received=report["received"], hint=f"r2s2r recover {quoted(path)}")  # fmt: skip
    nodes = tuple(NodeInfo.model_validate(node) for node in report["nodes"])
    return InspectResult(path=str(path), header=None, nodes=nodes)


def _show(result: InspectResult, console: Console) -> None:
    if console.json:
        return
    from schemas.versions import KINDS

    if result.header is None:
        console.data(f"{result.path}: an HDF5 file of another program")
    else:
        for name, text in _facts(result.header):
            console.data(f"{name:12} {text}")
    spec = KINDS.get(result.header["kind"]) if result.header else None
    rows = [row for node in result.nodes for row in _rows(node, spec)]
    console.table("", ["path", "shape", "dtype", "unit", "frame", "meaning"], rows)


def _rows(node: NodeInfo, spec: ArtifactSpec | None) -> Iterator[list[str]]:
    """A node, and below a group its attributes, each with its value; unit and meaning where the kind is known."""
    shape = "x".join(map(str, node.shape)) if node.shape is not None else ""
    yield [node.path, shape, node.dtype, node.unit, node.frame, node.description]
    group = spec.group(node.path) if spec else None
    told = {one.name: one for one in group.attributes} if group else {}
    for name, value in node.attributes.items():
        known = told.get(name)
        shown = (f"{value:.6g}" if isinstance(value, float) else str(value)) or "empty"
        if known is None:
            yield [f"{node.path}@{name}", "", "", "", "", shown]
        else:
            yield [f"{node.path}@{name}", "", known.type, known.unit, "", f"{shown} ({known.description})"]


def _facts(header: dict[str, Any]) -> list[tuple[str, str]]:
    made = header["provenance"]
    dirty = " (dirty)" if made["dirty"] else ""
    inputs = [f"{ref['path']} {ref['sha256'][:12]}" for ref in made["inputs"]]
    return [
        ("kind", f"{header['kind']} version {header['schema_version']}, {header['title']}"),
        ("content", header["content_sha256"]),
        ("made by", f"{header['created_by']} stage {made['stage']} version {made['stage_version']}"),
        ("commit", f"{made['commit']}{dirty}" if made["commit"] else "unknown"),
        ("started", f"{made['started']}, took {made['wall_s']} s"),
        ("command", " ".join(made["argv"])),
        *(("input", text) for text in inputs),
    ]


def _compare(path: Path, other: Path, console: Console) -> None:
    from r2s2r_cli.store.read import checked_header

    one, two = checked_header(path), checked_header(other)
    same = one.content_sha256 == two.content_sha256
    differences = _differences(one, two)
    console.document(
        InspectResult(path=str(path), header=one.model_dump(mode="json"), nodes=(), same=same, differences=differences)
    )
    if same:
        console.data("same content")
        return
    for line in differences:
        console.data(line)
    raise GateError("the contents differ", where=str(other), expected=one.content_sha256[:16],
                    received=two.content_sha256[:16], hint=f"r2s2r inspect {quoted(other)}")  # fmt: skip


def _differences(one: Header, two: Header) -> tuple[str, ...]:
    lines = []
    for path in sorted({**one.datasets, **two.datasets}):
        if path not in two.datasets:
            lines.append(f"only in the first: {path}")
        elif path not in one.datasets:
            lines.append(f"only in the second: {path}")
        elif one.datasets[path] != two.datasets[path]:
            lines.append(f"differs: {path}")
    if not lines and one.content_sha256 != two.content_sha256:
        lines.append("differs: attributes of groups, kind or version")
    return tuple(lines)
