"""What the guards go through: the files of the project and the registered commands."""

from __future__ import annotations

import functools
import re
import subprocess
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


FENCED = re.compile(r"^```(?:sh|bash|console|shell)?\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def inline_code(markdown: str) -> list[str]:
    """What stands between single backticks, outside the fenced blocks."""
    return re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", markdown, flags=re.DOTALL | re.MULTILINE))


def shell_lines(markdown: str) -> list[str]:
    """Command lines in the fenced code blocks of a page, without prompts, comments and continuation breaks."""
    lines = "\n".join(FENCED.findall(markdown)).replace("\\\n", " ").splitlines()
    return [text for line in lines if (text := re.sub(r"(^|\s)#.*", "", line).strip().removeprefix("$ "))]
