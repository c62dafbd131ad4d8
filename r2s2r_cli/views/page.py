"""One self-contained HTML page: what was found, in a sentence, tables and pictures. Opens without a network."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

_TEMPLATE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ page.title }}</title>
<style>
  body { font: 15px/1.5 system-ui, sans-serif; color: #1c2430; max-width: 72rem; margin: 2rem auto;
         padding: 0 1rem; }
  h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
  p.verdict { font-size: 1.1rem; }
  p.label { background: #fff3cd; border-left: 4px solid #b58900; padding: .4rem .8rem; }
  table { border-collapse: collapse; } th, td { padding: .2rem .8rem .2rem 0; text-align: left; vertical-align: top; }
  th { border-bottom: 1px solid #8792a2; }
  code { background: #eef2f7; padding: .1rem .3rem; }
  img { max-width: 100%; height: auto; }
</style>
</head>
<body>
<h1>{{ page.title }}</h1>
<p class="verdict">{{ page.sentence }}</p>
{% for note in page.notes %}<p>{{ note }}</p>
{% endfor %}
{% for label in page.labels %}<p class="label">{{ label }}</p>
{% endfor %}
{% for table in page.tables %}
<h2>{{ table.title }}</h2>
<table>
<thead><tr>{% for name in table.columns %}<th>{{ name }}</th>{% endfor %}</tr></thead>
<tbody>
{% for row in table.rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody>
</table>
{% endfor %}
{% if page.commands %}
<h2>commands</h2>
{% for what, line in page.commands %}<p>{{ what }}: <code>{{ line }}</code></p>
{% endfor %}
{% endif %}
{% for picture in page.pictures %}
<h2>{{ picture.title }}</h2>
<img alt="{{ picture.title }}" src="data:image/png;base64,{{ encoded(picture.png) }}">
{% endfor %}
</body>
</html>
"""


@dataclass(frozen=True)
class PageTable:
    """A table of a page; every number in a cell carries its unit, or its column's name does."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """A PNG of a page."""

    title: str
    png: bytes


@dataclass(frozen=True)
class Page:
    """What a page says, from top to bottom."""

    title: str
    sentence: str
    notes: Sequence[str] = ()
    """What the sentence's words mean."""
    labels: Sequence[str] = ()
    """What a reader must not overlook: a sample without physics, a warning."""
    tables: Sequence[PageTable] = ()
    commands: Sequence[tuple[str, str]] = ()
    """What for, and a command line, which is copied as one line however it is broken on the page."""
    pictures: Sequence[Picture] = ()


def counted(number: int, what: str) -> str:
    """`1 segment`, `2 segments`."""
    return f"{number} {what}{'s' * (number != 1)}"


def render(page: Page) -> bytes:
    """The page as UTF-8 HTML; every text is escaped."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(_TEMPLATE)
    return template.render(page=page, encoded=lambda png: base64.b64encode(png).decode()).encode()
