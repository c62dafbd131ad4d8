"""How an artifact came to be: arguments, settings, inputs, versions, commit, machine, times."""

from __future__ import annotations

import functools
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from r2s2r_cli import __version__
from r2s2r_cli.store.canonical import json_sha256
from schemas.header import InputRef, Provenance

PACKAGES = ("numpy", "scipy", "h5py", "torch", "open3d", "opencv-python-headless", "pydantic")
"""Whose versions can change a result; read from the installed metadata, nothing is imported."""
_GIT_LIMIT_S = 5.0


def build_provenance(
    *,
    stage: str,
    stage_version: int,
    argv: Sequence[str],
    settings: Mapping[str, Any],
    overrides: Mapping[str, Any],
    robot: Mapping[str, Any],
    inputs: Sequence[InputRef],
    started: datetime,
    wall_s: float,
    seed: int | None = None,
    threads: int | None = None,
    report: Mapping[str, Any] | None = None,
    drawings: Sequence[str] = (),
) -> Provenance:
    """The provenance of one artifact; `started` is timezone-aware, `wall_s` the time the stage took [s]."""
    commit, dirty = source_commit()
    return Provenance(
        stage=stage,
        stage_version=stage_version,
        argv=tuple(text.encode("utf-8", "backslashreplace").decode() for text in argv),  # names need not be UTF-8
        settings=dict(settings),
        overrides=dict(overrides),
        robot=dict(robot),
        config_sha256=config_sha256(settings, robot),
        inputs=tuple(inputs),
        seed=seed,
        threads=threads,
        versions=package_versions(),
        commit=commit,
        dirty=dirty,
        platform=f"{platform.platform()} {platform.machine()} python {platform.python_version()}",
        started=started.isoformat(timespec="seconds"),
        wall_s=round(wall_s, 3),
        report=dict(report or {}),
        drawings=tuple(drawings),
    )


def config_sha256(settings: Mapping[str, Any], robot: Mapping[str, Any]) -> str:
    """Digest of the effective configuration: settings and the used part of the robot."""
    return json_sha256({"settings": settings, "robot": robot})


def package_versions() -> dict[str, str]:
    """Installed versions of what can change a result."""
    return dict(_package_versions())


@functools.cache
def _package_versions() -> dict[str, str]:
    versions = {"r2s2r": __version__, "python": sys.version.split()[0]}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


@functools.cache
def source_commit() -> tuple[str | None, bool | None]:
    """Commit and dirty flag of the source checkout; (None, None) where r2s2r was installed from a wheel. Looked at once
    a process, which has loaded what it computes with."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None, None
    commit = _git(root, "rev-parse", "HEAD")
    changes = _git(root, "status", "--porcelain", "--untracked-files=no")
    return commit or None, None if changes is None else bool(changes)


def _git(root: Path, *arguments: str) -> str | None:
    try:
        result = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=_GIT_LIMIT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout.strip() if result.returncode == 0 else None
