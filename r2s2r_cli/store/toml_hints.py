"""What mends a wrong key or value, of a TOML file or of `--set`, as a command that can be pasted."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

SHORT = 5
"""Letters of a key from which on it stands in few other lines."""
Loc = tuple[int | str, ...]
Mend = Callable[[Loc, str], str]
"""Of the place of a wrong key or value, and the key that was meant (empty: another fault), the hint."""


def in_file(path: str) -> Mend:
    """For a file: the key is renamed where its one line is found, else its lines are shown."""

    def mend(loc: Loc, near: str) -> str:
        key = last_name(loc)
        if near and (script := _renaming(path, key, near)):
            return f"sed -i.bak -E {shlex.quote(script)} {shlex.quote(path)}"
        return shown(path, key)

    return mend


def in_override(overrides: Mapping[str, Any], model: type[BaseModel], otherwise: Callable[[Loc], str]) -> Mend:
    """For `--set`: the option with the key that was meant, or with the value that holds without it. otherwise: the hint
    where there is neither. An option alone is completed by the command."""

    def mend(loc: Loc, near: str) -> str:
        key = ".".join(map(str, loc))
        if near and key in overrides:
            return override(key.rpartition(".")[0] + "." * (len(loc) > 1) + near, overrides[key])
        usual = PydanticUndefined if near else default_at(model, loc)
        if usual is PydanticUndefined or key not in overrides:
            return otherwise(loc)
        return override(key, usual)

    return mend


def shown(path: str, key: str) -> str:
    """The lines of a file that name a key, with their numbers; the whole file where none does."""
    lines = _lines(path)
    if key and any(key in line for line in lines):
        # A key of one letter stands in every other line.
        whole = f"^ *{re.escape(key)} *="
        exact = any(re.match(whole, line) for line in lines)
        return f"grep -n {shlex.quote(whole if exact and len(key) < SHORT else key)} {shlex.quote(path)}"
    return f"cat -n {shlex.quote(path)}"


def around(path: str, line: int) -> str:
    """The lines of a file up to one where reading stopped: what is wrong stands there or just before."""
    lines = f"sed -n {max(1, line - 2)},{line}p" if line else "cat -n"
    return f"{lines} {shlex.quote(path)}"


def last_name(loc: Loc) -> str:
    """The key that a place ends in, without the numbers of list items."""
    return next((part for part in reversed(loc) if isinstance(part, str)), "")


def default_at(model: type[BaseModel], loc: Loc) -> Any:
    """The value of a setting that nobody sets; PydanticUndefined where there is none."""
    here: Any = model
    for part in loc:
        fields = getattr(here if isinstance(here, type) else type(here), "model_fields", {})
        field = next((one for name, one in fields.items() if (one.alias or name) == part), None)
        if field is None:
            return PydanticUndefined
        here = field.default
    return PydanticUndefined if isinstance(here, BaseModel) else here


def override(key: str, value: Any) -> str:
    """`--set KEY=VALUE` of a setting, like `override_text`; text that would be read as another type keeps quotes."""
    bare = isinstance(value, str) and "\n" not in value and _read(value) in (None, value)
    return override_text(key, value if bare else json.dumps(value, ensure_ascii=False))


def override_text(key: str, text: str) -> str:
    """`--set KEY=TEXT`, quoted for the shell: an option alone, which the command completes; text as typed."""
    return f"--set {shlex.quote(f'{key}={text}')}"


def _read(text: str) -> Any:
    """What `--set KEY=TEXT` would make of one line; None where it is no TOML, and so is taken as it stands."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return None


def _renaming(path: str, key: str, near: str) -> str:
    """The script for sed that gives a key, or a table, its right name; empty where not one line alone has it."""
    if not re.fullmatch(r"[\w-]+", key):
        return ""
    for pattern, script in (
        (rf"^ *{key} *=", rf"s/^( *){key}( *=)/\1{near}\2/"),
        (rf"^ *\[+{key}\]", rf"s/^( *\[+){key}\]/\1{near}]/"),
    ):
        if sum(re.search(pattern, line) is not None for line in _lines(path)) == 1:
            return script
    return ""


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeError):
        return []
