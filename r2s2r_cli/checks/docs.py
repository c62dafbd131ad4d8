"""The page docs/reference/checks.md, from the registry itself."""

from __future__ import annotations

from r2s2r_cli.checks import CHECKS, FAMILIES
from r2s2r_cli.checks.base import AGAIN, IMPORTANCES, Check, sentence

_HEAD = """\
# Checks

What `r2s2r validate` looks at. Each check has a name for `--select` and `--ignore`, and one of three importances:

{importances}

The exit code is 4 where a file cannot be read at all (missing, damaged, of a newer version, no TOML), else 3 where a
check found an error, else 0. Warnings and advice do not
count. Checks of the values run where the form of the file is right; checks against the robot run where the data are
of the project's robot by name and have as many caps, rods and cables as it.
"""


_MAKE_AGAIN = "Make the artifact again with `--force`, by the line that `validate` shows"
"""That line has the stage, the iteration and the options of then."""


def checks_page() -> str:
    """The page, without the note that it is generated."""
    importances = "\n".join(f"- **{name}**: {text}" for name, text in IMPORTANCES.items())
    parts = [_HEAD.format(importances=importances), _overview()]
    for family, title in FAMILIES.items():
        parts.append(f"## {title}\n")
        parts += [_section(entry) for entry in CHECKS if entry.family == family]
    return "\n".join(parts)


def _overview() -> str:
    rows = [f"| [`{c.name}`](#{c.name}) | {c.importance} | {_scope(c)} |" for c in CHECKS]
    return "\n".join(["| check | importance | looks at |", "| --- | --- | --- |", *rows, ""])


def _typed(fix: str) -> str:
    """A command as it is typed, with its remark behind it; words as a sentence."""
    command, _, remark = fix.partition("   # ")
    if command == AGAIN:
        return f"{_MAKE_AGAIN}: {sentence(remark)[0].lower()}{sentence(remark)[1:]}" if remark else f"{_MAKE_AGAIN}."
    if remark:
        return f"`{command}`: {sentence(remark)[0].lower()}{sentence(remark)[1:]}"
    return f"`{command}`" if command.startswith("r2s2r ") else sentence(fix)


def _section(entry: Check) -> str:
    fix = entry.fix.replace("{file}", "FILE").replace("{location}", "PLACE")
    return (
        f"### {entry.name}\n\n"
        f"{entry.importance.capitalize()}; looks at {_scope(entry)}.\n\n"
        f"- **What it checks.** {sentence(entry.what)}\n"
        f"- **Why.** {sentence(entry.why)}\n"
        f"- **How to fix.** {_typed(fix)}\n"
    )


_SCOPES = {
    "Reading": "every file",
    "Content": "every artifact",
    "Links": "every artifact",
    "Journals": "the project",
    "Run": "every run",
    "Policy": "policies: TOML files, and those in artifacts",
    "Robot": "robot.toml",
}


def _scope(entry: Check) -> str:
    if not entry.kinds:
        return _SCOPES[entry.subject.__name__]
    return ", ".join(entry.kinds)
