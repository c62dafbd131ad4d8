"""TOML files that people write: read, checked against their model, errors in words with near matches."""

from __future__ import annotations

import functools
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import BaseModel, ValidationError

from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.nearest import nearest
from r2s2r_cli.store.toml_hints import Mend, around, in_file

Model = TypeVar("Model", bound=BaseModel)
MAX_BYTES = 4 << 20
"""A TOML file larger than this was not written by hand."""


def read_toml(path: Path) -> dict[str, Any]:
    """The parsed file. Raises InputError: missing, not text, not TOML (with line and column)."""
    return parse_toml(read_text(path), str(path))


def read_text(path: Path) -> str:
    """A small UTF-8 text file. Raises InputError."""
    try:
        if path.exists() and not path.is_file():
            raise InputError("this is not a file", where=str(path), expected="a TOML file",
                             received="a directory" if path.is_dir() else "a pipe, socket or device",
                             hint=f"ls -la {quoted(path)}")  # fmt: skip
        if path.stat().st_size > MAX_BYTES:
            raise InputError("the file is too large for a TOML file", where=str(path), expected="at most 4 MB",
                             received=f"{path.stat().st_size} bytes", hint=f"ls -la {quoted(path)}")  # fmt: skip
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("the file is not UTF-8 text", where=f"{path}, byte {error.start}", expected="UTF-8 text",
                         received=repr(error.object[error.start : error.start + 1]),
                         hint=f"file {quoted(path)}") from error  # fmt: skip
    except OSError as error:
        raise InputError("the file cannot be read", where=str(path), expected="a TOML file",
                         received=error.strerror or str(error),
                         hint=f"ls -la {quoted(path.parent)}") from error  # fmt: skip


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Parse TOML text. Raises InputError with the position."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        line = re.search(r"at line (\d+)", str(error))
        raise InputError("the file is not valid TOML", where=where, received=str(error)[:200],
                         expected="TOML: values are text in quotes, numbers, true, false or [lists]",
                         hint=around(where, int(line[1]) if line else 0)) from error  # fmt: skip


def load_model(path: Path, model: type[Model]) -> Model:
    """Read and check a TOML file. Raises InputError naming the first wrong key, with the nearest right one."""
    text = read_text(path)
    try:
        return cast(Model, _valid(text, model))
    except (ValueError, RecursionError):  # no TOML, or not this model: in words, then
        return check_model(parse_toml(text, str(path)), model, str(path))


@functools.lru_cache(maxsize=8)
def _valid(text: str, model: type[BaseModel]) -> BaseModel:
    """The model of a text, parsed and checked once while a process asks for it again; models are immutable."""
    return model.model_validate(tomllib.loads(text))


def check_model(values: dict[str, Any], model: type[Model], where: str, mend: Mend | None = None) -> Model:
    """Check parsed values against their model. mend: makes the hints; by default `where` is a file. Raises InputError
    as `load_model` does."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise _problems(error, model, where, mend or in_file(where))[0] from error


def model_problems(values: dict[str, Any], model: type[BaseModel], where: str) -> list[InputError]:
    """Everything that is wrong with parsed values, one error each; empty where nothing is."""
    try:
        model.model_validate(values)
    except ValidationError as error:
        return _problems(error, model, where, in_file(where))
    return []


def _problems(error: ValidationError, model: type[BaseModel], where: str, mend: Mend) -> list[InputError]:
    """What pydantic found, in our form. Unknown keys come first: a misspelt one is also missing under its right name,
    which then goes without saying; and so does a list that is too short because its items are wrong."""
    everything = error.errors()
    places = [p["loc"] for p in everything]
    found = [p for p in everything if p["type"] != "too_short" or not _is_above(p["loc"], places)]
    unknown = [_unknown_key(p["loc"], model, where, mend) for p in found if p["type"] == "extra_forbidden"]
    strange = [p["loc"] for p in found if p["type"] == "extra_forbidden"]
    meant = {(*loc[:-1], name) for loc in strange if (name := _near(loc, model))}
    rest = [p for p in found if p["type"] != "extra_forbidden" and not (p["type"] == "missing" and p["loc"] in meant)]
    return unknown + [_wrong_value(p, where, mend) for p in rest]


def _is_above(loc: tuple[int | str, ...], others: list[tuple[int | str, ...]]) -> bool:
    return any(len(other) > len(loc) and other[: len(loc)] == loc for other in others)


def _wrong_value(problem: Any, where: str, mend: Mend) -> InputError:
    key = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "missing":
        return InputError("a key is missing", where=where, received="nothing",
                          expected=f"a value for {key}: {key.rpartition('.')[2]} = ...",
                          hint=mend(problem["loc"], ""))  # fmt: skip
    received = "" if isinstance(problem["input"], dict | list) else repr(problem["input"])[:80]
    return InputError(
        f"the value of {key} is not allowed" if key else "the values do not fit together",
        where=f"{where}, key {key}" if key else where,
        expected=problem["msg"].removeprefix("Value error, ").removeprefix("Input should be "),
        received=received,
        hint=mend(problem["loc"], ""),
    )


def _near(loc: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """The known key that an unknown one was probably meant to be; empty where none is near."""
    return nearest(str(loc[-1]), _keys_at(model, loc[:-1]))


def _unknown_key(loc: tuple[int | str, ...], model: type[BaseModel], where: str, mend: Mend) -> InputError:
    known, near = _keys_at(model, loc[:-1]), _near(loc, model)
    return InputError(f"unknown key {'.'.join(map(str, loc))}", where=where, received=str(loc[-1]),
                      expected=near or " | ".join(known) or "no key",
                      hint=mend(loc, near))  # fmt: skip


def _keys_at(model: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    """The keys that the (possibly nested) model at `loc` knows."""
    current: Any = model
    for part in loc:
        if isinstance(part, int):
            continue
        fields = {field.alias or name: field for name, field in current.model_fields.items()}
        current = _model_in(fields[part].annotation)
        if current is None:
            return []
    return [field.alias or name for name, field in current.model_fields.items()]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_in(argument)
        if found is not None:
            return found
    return None
