"""Write what is derived from the models: `python -m schemas.generate [--check]`.

schemas/json/*.json: the JSON Schema of every model that users' files and other programs meet, and the layout of every
artifact kind. schemas/LAYOUT.md: the layouts as tables. CI compares both with what is committed.
"""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import schemas
from schemas.base import DIM_SIZES, ArtifactSpec, Frozen, GroupSpec
from schemas.blind import BlindPublished
from schemas.config import ProjectFile, RunConfig
from schemas.header import Header
from schemas.policy import PolicyFile
from schemas.robot import Robot
from schemas.sidecar import Sidecar
from schemas.versions import KINDS

HOME = Path(__file__).resolve().parent
FILES: dict[str, type[BaseModel]] = {
    "project": ProjectFile, "config": RunConfig, "robot": Robot, "policy": PolicyFile, "sidecar": Sidecar,
    "header": Header, "blind_published": BlindPublished,
}  # fmt: skip
"""Models of files, by the name of their JSON Schema."""
_BASE = "https://json-schema.org/draft/2020-12/schema"


def main() -> None:
    """Write the derived files; with --check only compare, and leave with 1 where one differs."""
    wanted = {HOME / name: text for name, text in derived().items()}
    present = {*(HOME / "json").glob("*.json"), HOME / "LAYOUT.md"}
    stale = sorted(path for path, text in wanted.items() if not path.exists() or path.read_text("utf-8") != text)
    superfluous = sorted(present - wanted.keys())
    if "--check" in sys.argv[1:]:
        for path in stale + superfluous:
            print(f"{path.relative_to(HOME.parent)} is not what the models give: python -m schemas.generate")
        raise SystemExit(1 if stale or superfluous else 0)
    (HOME / "json").mkdir(exist_ok=True)
    for path in stale:
        path.write_text(wanted[path], encoding="utf-8")
    for path in superfluous:
        path.unlink(missing_ok=True)


def derived() -> dict[str, str]:
    """Every derived file: path relative to this package, and its text."""
    documents = {f"json/{name}.json": json_schema(model) for name, model in {**FILES, **results()}.items()}
    documents |= {f"json/layout_{kind}.json": layout(spec) for kind, spec in KINDS.items()}
    texts = {path: json.dumps(value, indent=2, ensure_ascii=False) + "\n" for path, value in documents.items()}
    return {**texts, "LAYOUT.md": "\n".join(layout_page(KINDS.values())) + "\n"}


def results() -> dict[str, type[BaseModel]]:
    """The models of `--json` and of stage reports in the modules `schemas.results*`, by the name of their file."""
    found: dict[str, type[BaseModel]] = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(schemas.__path__) if m.name.startswith("results")):
        for name, model in inspect.getmembers(importlib.import_module(f"schemas.{module}"), inspect.isclass):
            named = name.endswith(("Result", "Report")) and model.__module__ == f"schemas.{module}"
            if named and issubclass(model, Frozen):
                found["result_" + _snake(name.removesuffix("Result"))] = model
    return found


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of a model, draft 2020-12."""
    return {"$schema": _BASE, **model.model_json_schema(by_alias=True)}


def layout(spec: ArtifactSpec) -> dict[str, Any]:
    """The layout of one artifact kind as JSON, for readers in other languages."""
    return {"axes_of_fixed_length": DIM_SIZES, **spec.model_dump(mode="json", exclude_defaults=False)}


def layout_page(specs: Iterable[ArtifactSpec]) -> Iterator[str]:
    """The page of all layouts, line by line."""
    yield "# What is in the artifacts"
    yield ""
    yield "Made by `python -m schemas.generate` from the specifications in this folder; do not edit."
    yield ""
    yield "- All numbers are SI. Frames: `W` world (z up), `R` rod, `C` camera; `p_WE` is the position of E in W."
    yield "- Time is the first axis. An axis of one name has one length within a run (outside runs: within a group)."
    fixed = ", ".join(f"`{name}` {size}" for name, size in DIM_SIZES.items())
    yield f"- Axes of fixed length: {fixed}."
    yield "- `blobs` are encoded images: on disk the group `<path>` with `bytes` (uint8) and `offset` (uint64, one more"
    yield "  than frames). `str` is fixed-length UTF-8. NaN stands only where the table says what it means."
    yield "- Root attributes of every artifact: `kind`, `schema_version`, `title`, `created_by`, `content_sha256`,"
    yield "  `seal_sha256`. Group `/provenance`: one JSON text a field. Both stand in the head of the file too."
    for spec in specs:
        yield ""
        yield f"## {spec.kind}, version {spec.version}"
        yield ""
        place = "in the project" if spec.level == "project" else "in each iteration"
        names = " or, of the executed plan, ".join(f"`{name}`" for name in spec.filenames)
        yield f"{_sentence(spec.title)}. {names} {place}."
        for group in spec.groups:
            yield from _group(group)


def _group(group: GroupSpec) -> Iterator[str]:
    yield ""
    yield f"### `/{group.path}`"
    yield ""
    always = " Always there." if group.required else ""
    yield f"{_sentence(group.description)}.{always}"
    if group.datasets:
        yield ""
        yield "| dataset | dtype | axes | unit | frame | required | meaning |"
        yield "|---|---|---|---|---|---|---|"
    for d in group.datasets:
        codes = "; ".join(f"{code} {_cell(text)}" for code, text in d.codes.items())
        words = [
            _cell(d.description),
            f"codes: {codes}" if codes else "",
            f"NaN: {_cell(d.nan_means)}" if d.nan_means else "",
        ]
        axes = ", ".join(d.dims)
        yield (f"| `{d.path}` | {d.dtype} | {axes} | {_unit(d.unit)} | {d.frame} | {_yes(d.required)} "
               f"| {'. '.join(filter(None, words))} |")  # fmt: skip
    if group.attributes:
        yield ""
        yield "| attribute | type | unit | required | meaning |"
        yield "|---|---|---|---|---|"
    for a in group.attributes:
        choices = f". One of: {', '.join(a.choices)}" if a.choices else ""
        unit = _unit(a.unit) if a.type in ("int", "float") else ""
        yield f"| `{a.name}` | {a.type} | {unit} | {_yes(a.required)} | {_cell(a.description)}{choices} |"


def _yes(required: bool) -> str:
    return "yes" if required else ""


def _unit(unit: str) -> str:
    return unit.replace("^", "\\^")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).strip("_")


if __name__ == "__main__":
    main()
