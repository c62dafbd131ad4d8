"""The text of `project.toml`: every setting with its default, its meaning above it."""

from __future__ import annotations

import textwrap

from pydantic import BaseModel

from schemas.config import LinkSettings, ProjectFile, RunConfig

_HEAD = """\
# Project settings of r2s2r. An iteration may override them in iterations/NNN/config.toml,
# one command with --set section.key=value; `r2s2r estimate --show-config` prints what holds.
"""


def project_toml(name: str) -> str:
    """A commented `project.toml` for a project of this name; it parses to the defaults of ProjectFile."""
    import tomlkit

    document = tomlkit.parse(_HEAD)
    document["schema_version"] = 1
    document["name"] = name
    document["robot"] = "robot.toml"
    sections = {field.alias or key: field.get_default(call_default_factory=True)
                for key, field in RunConfig.model_fields.items()}  # fmt: skip
    for key, default in {"link": LinkSettings(), **sections}.items():
        section = tomlkit.table()
        _fill(section, default)
        if section:
            document.add(tomlkit.nl())
            document[key] = section
    text = tomlkit.dumps(document)
    ProjectFile.model_validate(document.unwrap())
    return text


def _fill(section: object, settings: BaseModel) -> None:
    import tomlkit
    from tomlkit.items import Table

    if not isinstance(section, Table):
        raise TypeError("a settings section is a TOML table")
    for key, field in type(settings).model_fields.items():
        for line in textwrap.wrap(field.description or "", 100):
            section.add(tomlkit.comment(line))
        section[field.alias or key] = getattr(settings, key)
