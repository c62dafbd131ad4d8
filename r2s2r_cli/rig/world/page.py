"""The page docs/reference/world.md, from the tables of the world file themselves."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from r2s2r_cli.rig.world.faults import Fault
from r2s2r_cli.rig.world.file import World
from schemas.described import texts_of

EXAMPLE = """\
seed = 7

[floor]
friction = 0.6

[start]
position_m = [0.05, -0.1]
heading_rad = 0.4

[boards]
layout = "per_rod"

[sensors]
day_sd_m = 0.003

[camera]
position_m = [0.0, 0.0, 2.4]

[camera.clock]
rate_hz = 15.0

[effects.motor_lag]
start_s = 0.12

[effects.friction_field]
patches = [{ center_m = [0.3, 0.0], radius_m = 0.15, factor = 0.3 }]

[[faults]]
kind = "sensor_stuck"
sensor = 4
at_s = 20.0
for_s = 5.0

[wire]
lost = 0.01
"""
"""A world file that uses every kind of table; a test reads it."""

_HEAD = f"""\
# The world file

What `r2s2r rig --world world.toml` simulates beyond `robot.toml`: the floor, the errors of sensors and camera, what
breaks, and which unmodelled laws hold. It is read by the rig alone: no other command may know it. TOML, SI units, frame
W with z against gravity and its origin on the floor. Every key may be left out; an unknown one is an error. An empty
file is a robot with ideal motors and cables, and with the ordinary errors of its sensors and camera. What each effect
does: [effects of the rig](../concepts/rig-effects.md).

```toml
{EXAMPLE}```
"""
_NO_DEFAULT = "required"


def world_page() -> str:
    """The whole page, without the note that it is generated."""
    parts = [_HEAD, *_tables("", World)]
    parts.append("## Faults\n\nEach is a `[[faults]]` with a `kind`. Faults of the camera are in `[camera.faults]`.\n")
    for kind in get_args(get_args(Fault)[0]):
        name = get_args(kind.model_fields["kind"].annotation)[0]
        parts.append(f'### kind = "{name}"\n\n{_says(kind)}\n\n{_rows(kind, without=("kind",))}\n')
    return "\n".join(parts).rstrip() + "\n"


def documented() -> Iterator[tuple[str, str]]:
    """(table, key) of everything that can stand in a world file, faults apart."""
    yield from _keys("", World)


def undocumented() -> Iterator[tuple[str, str]]:
    """(table, key) of everything without a text of its own, faults and items of lists included."""
    yield from _silent("", World)
    for kind in get_args(get_args(Fault)[0]):
        name = get_args(kind.model_fields["kind"].annotation)[0]
        yield from ((table, key) for table, key in _silent(name, kind) if key != "kind")


def _silent(table: str, model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    texts = _attribute_texts(model)
    for name, field in model.model_fields.items():
        inner, items = _table_of(field), _items_of(field)
        if inner is not None:
            yield from _silent(f"{table}.{name}".strip("."), inner)
        elif not texts.get(name):
            yield table, name
        if items is not None:
            yield from _silent(f"{table}.{name}".strip("."), items)


def _keys(table: str, model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    for name, field in model.model_fields.items():
        inner = _table_of(field)
        if inner is None:
            yield table, name
        else:
            yield from _keys(f"{table}.{name}".strip("."), inner)


def _tables(table: str, model: type[BaseModel]) -> Iterator[str]:
    level = "##" if table.count(".") == 0 else "###"
    if any(_table_of(field) is None for field in model.model_fields.values()):
        title = f"`[{table}]`" if table else "The file itself"
        yield f"{level} {title}\n\n{_says(model)}\n\n{_rows(model)}\n"
    elif table:
        yield f"{level} `[{table}.<id>]`\n\n{_says(model)}\n"
    for name, field in model.model_fields.items():
        inner = _table_of(field)
        if inner is not None:
            yield from _tables(f"{table}.{name}".strip("."), inner)


def _rows(model: type[BaseModel], without: tuple[str, ...] = ()) -> str:
    texts = _attribute_texts(model)
    rows = ["| key | default | |", "| --- | --- | --- |"]
    for name, field in model.model_fields.items():
        if name in without or _table_of(field) is not None:
            continue
        items = _items_of(field)
        text = texts.get(name, "") + (f" Each: {_listed(items)}." if items else "")
        rows.append(f"| `{name}` | {_default(field)} | {text.strip()} |")
    return "\n".join(rows)


def _listed(model: type[BaseModel]) -> str:
    texts = _attribute_texts(model)
    return "; ".join(
        f"`{name}` ({_default(field)}) {texts.get(name, '').rstrip('.')}".rstrip()
        for name, field in model.model_fields.items()
    )


def _table_of(field: FieldInfo) -> type[BaseModel] | None:
    """The model of a key that is a table of its own."""
    for kind in (field.annotation, *get_args(field.annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel) and not _is_tuple(field.annotation):
            return kind
    return None


def _items_of(field: FieldInfo) -> type[BaseModel] | None:
    """The model of the elements of a key that is a list of tables."""
    if not _is_tuple(field.annotation):
        return None
    first = get_args(field.annotation)[0]
    return first if isinstance(first, type) and issubclass(first, BaseModel) else None


def _is_tuple(kind: Any) -> bool:
    return getattr(kind, "__origin__", None) is tuple


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return _NO_DEFAULT
    value = field.default
    if value is None:
        return "-"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`[{', '.join(f'{x:g}' if isinstance(x, int | float) else str(x) for x in value)}]`"
    return f"`{value:g}`" if isinstance(value, float | int) else f'`"{value}"`'


def _says(model: type[BaseModel]) -> str:
    return " ".join(inspect.cleandoc(model.__doc__ or "").split())


def _attribute_texts(model: type[BaseModel]) -> dict[str, str]:
    """What stands below each field, base classes included; a text below several fields is that of the last of them."""
    texts: dict[str, str] = {}
    for one in reversed(model.__mro__):
        if issubclass(one, BaseModel) and one is not BaseModel:
            texts |= {name: " ".join(text.split()) for name, text in texts_of(one).items()}
    return texts
