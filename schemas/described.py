"""Models whose fields are described by the texts below them.

Pydantic can read these texts as well, but does so whenever a class is defined: every command would parse this source.
"""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from typing import Any

from pydantic import BaseModel, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from schemas.base import Frozen


@functools.cache
def texts_of(model: type[BaseModel]) -> dict[str, str]:
    """The text below each field that this class itself defines, by the field's name."""
    body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0]
    if not isinstance(body, ast.ClassDef):
        raise TypeError("the source of a class is a class")
    found = {}
    for statement, after in zip(body.body, body.body[1:], strict=False):
        match statement, after:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                found[name] = inspect.cleandoc(text)
    return found


class Described(Frozen):
    """Base of sections whose fields have a text below them; their JSON Schema has it too."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        described = handler(core_schema)
        properties = handler.resolve_ref_schema(described)["properties"]
        for name, text in texts_of(cls).items():
            properties[cls.model_fields[name].alias or name]["description"] = text
        return described
