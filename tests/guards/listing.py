"""What the guards go through: the files of the project and the registered commands."""

from __future__ import annotations

import functools
import re
import shlex
import subprocess
from itertools import dropwhile, groupby
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@functools.cache
def project_files() -> tuple[Path, ...]:
    """Files of the project: tracked, and new ones that git does not ignore. Skips outside a git checkout."""
    listing = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    done = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip("not a git checkout: there is no list of the project's files")
    paths = (ROOT / name for name in done.stdout.split("\0") if name)
    return tuple(sorted(path for path in paths if path.is_file()))


def python_files(*folders: str) -> list[Path]:
    """Python files of the project under the given top-level folders."""
    return [p for p in project_files() if p.suffix == ".py" and p.relative_to(ROOT).parts[0] in folders]


def name(path: Path) -> str:
    """Path relative to the project, as tests show it."""
    return path.relative_to(ROOT).as_posix()


@functools.cache
def commands() -> dict[str, Any]:
    """Registered commands as the command line sees them, by name; those of a group as `group command`, and the group
    itself where it does something without one."""
    import typer.main

    from r2s2r_cli.app import app

    found: dict[str, Any] = {}
    for top, command in typer.main.get_group(app).commands.items():
        below = getattr(command, "commands", None)
        if below is None or command.invoke_without_command:
            found[top] = command
        found |= {f"{top} {sub}": inner for sub, inner in (below or {}).items()}
    return found


FENCED = re.compile(r"^( *)(```+)(\w*)[^\n]*\n(.*?)^\1\2 *$", flags=re.DOTALL | re.MULTILINE)
"""Indentation, fence, language and text of a block. The closing fence is part of it, or it would open the next one."""
SHELLS = {"", "sh", "bash", "console", "shell"}


def inline_code(markdown: str) -> list[str]:
    """What stands between single backticks, outside the fenced blocks, on one line each."""
    return [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", FENCED.sub("", markdown))]


def shell_lines(markdown: str) -> list[str]:
    """Command lines in the fenced code blocks of a page, without prompts, comments and continuation breaks."""
    blocks = [block[4] for block in FENCED.finditer(markdown) if block[3] in SHELLS]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [text for line in lines if (text := re.sub(r"(^|\s)#.*", "", line).strip().removeprefix("$ "))]


def shell_commands(markdown: str) -> list[list[str]]:
    """Words of every `r2s2r` command in the code blocks of a page, without the name.

    A command stands between pipes, `&&` and redirections, and after settings of the environment.
    """
    found = []
    for line in shell_lines(markdown):
        if "r2s2r " not in line:
            continue
        reader = shlex.shlex(line, posix=True, punctuation_chars=True)
        reader.whitespace_split, reader.commenters = True, ""
        for operator, words in groupby(reader, key=lambda word: set(word) <= set("();<>|&")):
            rest = list(dropwhile(lambda word: re.match(r"\w+=", word), words))
            if not operator and rest[:1] == ["r2s2r"]:
                found.append(rest[1:])
    return found
