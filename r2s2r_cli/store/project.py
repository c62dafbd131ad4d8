"""The project directory: where things are, and how the settings of a stage come together."""

from __future__ import annotations

import os
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import ArtifactError, InputError, UsageError
from r2s2r_cli.store.first_data import first_data
from r2s2r_cli.store.toml import check_model, load_model, read_toml
from r2s2r_cli.store.toml_hints import in_override
from schemas.config import ProjectFile, RunConfig
from schemas.robot import Robot
from schemas.versions import KINDS

PROJECT_FILE = "project.toml"
CONFIG_FILE = "config.toml"
STATE_DIR = ".r2s2r"
"""What r2s2r keeps for itself: the write lock, compiled code. May be deleted while nothing runs."""
SHARED_CACHE = "R2S2R_CACHE"
"""Environment variable: where compiled code is kept instead, for all projects."""
MAX_ITERATION = 9999
"""The largest number that an iteration has."""
ITERATIONS = "iterations"
JOURNAL_SUFFIX = ".journal"
_A_NEW_ONE = "r2s2r init myrobot && cd myrobot"
_HEAD_KEYS = ("schema_version", "name", "robot", "link")


@dataclass(frozen=True)
class Iteration:
    """One pass of the loop: a directory `iterations/NNN`."""

    number: int
    path: Path

    def artifact(self, kind: str, *, executed: bool = False) -> Path:
        """Where this iteration keeps its artifact of `kind`, written or not. executed: that of the executed plan."""
        spec = KINDS[kind]
        if executed and spec.executed is None:
            raise ValueError(f"an execution leaves no artifact of kind {kind}")
        return self.path / (spec.executed if executed and spec.executed else spec.filename)


@dataclass(frozen=True)
class Project:
    """A project directory with its files, as they were when a command first read them: what it computes with and what
    it says that it computed with are the same, though somebody edits them meanwhile."""

    root: Path
    file: ProjectFile
    _read: dict[Path, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def find(cls, start: Path | None = None) -> Project:
        """The project of `start` (default: the working directory) or of its nearest parent.

        Raises ArtifactError where there is none; InputError where project.toml is wrong.
        """
        explicit = start is not None
        origin = (start or Path.cwd()).absolute()
        candidates = [origin] if explicit else [origin, *origin.parents]
        for root in candidates:
            if (root / PROJECT_FILE).is_file():
                return cls(root, load_model(root / PROJECT_FILE, ProjectFile))
        raise ArtifactError(
            "there is no project here",
            where=str(origin),
            expected=f"a directory with {PROJECT_FILE}" + ("" if explicit else ", here or above"),
            received="none",
            hint=_A_NEW_ONE if explicit else _into(origin),
        )

    @property
    def robot_path(self) -> Path:
        """The robot description."""
        return self.root / self.file.robot

    def robot(self) -> Robot:
        """The robot description, checked. Raises InputError."""
        path = self.robot_path
        if path not in self._read:
            self._read[path] = load_model(path, Robot)
        robot: Robot = self._read[path]
        return robot

    @property
    def cache(self) -> Path:
        """Compiled steps of the engine, kept between commands; made again where they are missing. Many projects of one
        machine need not compile the same each for itself: the environment variable R2S2R_CACHE names a folder of all.
        """
        shared = os.environ.get(SHARED_CACHE)
        return Path(shared).expanduser().absolute() if shared else self.root / STATE_DIR / "cache"

    def iterations(self) -> list[Iteration]:
        """All iterations, in order."""
        folder = self.root / ITERATIONS
        found = [p for p in folder.iterdir() if _is_iteration(p.name) and p.is_dir()] if folder.is_dir() else []
        return [Iteration(int(p.name), p) for p in sorted(found, key=lambda p: int(p.name))]

    def iteration(
        self, number: int | None, *, create: bool = False, first: str = ""
    ) -> Iteration:  # fmt: skip
        """Iteration `number`, default the latest (with `create`: the first, where there is none). first:
        the command that a project without iterations is hinted; default: that which brings its first data.

        Raises ArtifactError where there is none yet, UsageError where this one does not exist and is not to be created,
        or is beyond the next one: a slip of the finger would become "the latest".
        """
        existing = self.iterations()
        if number is None:
            if existing:
                return existing[-1]
            if not create:
                raise ArtifactError("there is no iteration yet", where=str(self.root / ITERATIONS), received="none",
                                    expected="at least one", hint=first or self.first_data())  # fmt: skip
            number = 1
        if not 1 <= number <= MAX_ITERATION:
            raise UsageError("there is no such iteration number", where="--iteration",
                             expected=f"1 to {MAX_ITERATION}", received=str(number), hint="r2s2r status")  # fmt: skip
        path = self.root / ITERATIONS / f"{number:03d}"
        following = existing[-1].number + 1 if existing else 1
        if path.is_dir() or (create and number <= following):  # one that was removed may be made again
            return Iteration(number, path)
        if create:
            wanted = f"{following}, which is the next, or one before it" if existing else "1, the first"
            raise UsageError(f"iteration {number} is not the next one", where="--iteration", expected=wanted,
                             received=str(number), hint=f"--iteration {following}")  # fmt: skip
        known = ", ".join(str(i.number) for i in existing) or "none yet"
        raise UsageError(f"iteration {number} does not exist", where="--iteration", expected=f"one of: {known}",
                         received=str(number), hint="r2s2r status")  # fmt: skip

    def first_data(self, iteration: Iteration | None = None) -> str:
        """The command that brings data where there is none at all, into an iteration where it has to be said."""
        options = "" if iteration is None else f"--iteration {iteration.number}"
        return first_data(self.root, self.file.link, options=options)

    def artifact(self, kind: str, iteration: Iteration | None, *, executed: bool = False) -> Path:
        """Where the artifact of `kind` lies: in the project, or in the iteration. executed: of the executed plan."""
        if KINDS[kind].level == "project":
            return self.root / KINDS[kind].filename
        if iteration is None:
            raise ValueError(f"{kind} belongs to an iteration")
        return iteration.artifact(kind, executed=executed)

    def relative(self, path: Path) -> str:
        """`path` relative to the project, with forward slashes; above it with `../`."""
        return Path(os.path.relpath(path.resolve(), self.root.resolve())).as_posix()

    def config(self, iteration: Iteration | None, overrides: dict[str, Any]) -> RunConfig:
        """The effective settings: project.toml < the iteration's config.toml < `overrides` (dotted keys).

        Raises InputError for a wrong file, UsageError for a wrong override.
        """
        values = {k: v for k, v in self.file.model_dump(by_alias=True).items() if k not in _HEAD_KEYS}
        local = iteration.path / CONFIG_FILE if iteration else None
        if local is not None:
            if local not in self._read:
                found = read_toml(local) if local.is_file() else {}
                check_model(found, RunConfig, str(local))  # first: asked again, the error names this file again
                self._read[local] = found
            values = _merge(values, self._read[local])
        for key, value in overrides.items():
            values = _merge(values, _nest(key, value))
        try:
            if not overrides:
                return check_model(values, RunConfig, str(self.root / PROJECT_FILE))
            mend = in_override(overrides, RunConfig, lambda loc: f"r2s2r {loc[0]} --show-config")
            return check_model(values, RunConfig, "--set", mend)
        except InputError as error:
            if not overrides:
                raise
            raise UsageError(error.what, where=error.where, expected=error.expected, received=error.received,
                             hint=error.hint) from error  # fmt: skip

    def artifacts(self) -> list[Path]:
        """Every artifact that is there, in the order of the data: of the project, then of each iteration."""
        places = [(self.root, "project"), *((iteration.path, "iteration") for iteration in self.iterations())]
        names = {
            level: sorted(name for spec in KINDS.values() if spec.level == level for name in spec.filenames)
            for level in ("project", "iteration")
        }
        candidates = [folder / name for folder, level in places for name in names[level]]
        return [path for path in candidates if path.is_file()]

    def journals(self) -> list[Path]:
        """Recordings that were not sealed."""
        return sorted((self.root / ITERATIONS).glob(f"*/*{JOURNAL_SUFFIX}"))


def _is_iteration(name: str) -> bool:
    """Whether a directory is called as the iteration of its number is: `0009` would be a second ninth one."""
    return re.fullmatch(r"\d{3,}", name) is not None and name == f"{int(name):03d}"


def iteration_number(folder: Path) -> int | None:
    """The number that a folder is called by, `iterations/007` or any other; None where its name is no number. The
    digits of ASCII alone: `²` is one for `str.isdigit`, and none for `int`."""
    return int(folder.name) if folder.name.isascii() and folder.name.isdigit() else None


def _into(folder: Path) -> str:
    """How to come to a project from a folder above it: into the first one that lies there, else by a new one."""
    try:
        below = sorted(one.name for one in folder.iterdir() if (one / PROJECT_FILE).is_file())
    except OSError:
        below = []
    return f"cd {shlex.quote(below[0])}" if below else _A_NEW_ONE


def root_of(path: Path) -> Path | None:
    """The nearest folder above `path` with a project.toml, readable or not; None where there is none."""
    return next((folder for folder in path.absolute().parents if (folder / PROJECT_FILE).is_file()), None)


def journal_of(artifact: Path) -> Path:
    """Where the rows of an artifact are while it is recorded."""
    return artifact.with_name(artifact.name + JOURNAL_SUFFIX)


def artifact_of(journal: Path) -> Path:
    """The artifact that a journal becomes."""
    return journal.with_name(journal.name.removesuffix(JOURNAL_SUFFIX))


def _merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        known = result.get(key)
        result[key] = _merge(known, value) if isinstance(known, dict) and isinstance(value, dict) else value
    return result


def _nest(key: str, value: Any) -> dict[str, Any]:
    for part in reversed(key.split(".")):
        value = {part: value}
    return value
