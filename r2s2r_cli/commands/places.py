"""Projects that files belong to, and which of their files `validate` looks at."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from r2s2r_cli.checks.subjects import Journals
from r2s2r_cli.errors import ArtifactError, R2S2RError, UsageError
from r2s2r_cli.store.journal_read import unwatched
from r2s2r_cli.store.project import CONFIG_FILE, ITERATIONS, JOURNAL_SUFFIX, PROJECT_FILE, Project
from schemas.robot import Robot

ROBOT_FILE = "robot.toml"


@dataclass(frozen=True)
class Place:
    """The project that a file belongs to, as far as it can be read."""

    root: Path
    project: Project | None = None
    robot: Robot | None = None
    problem: R2S2RError | None = None
    """Why `project` or `robot` is None."""


@dataclass
class Places:
    """The projects of the files of one command; each is loaded once."""

    known: dict[Path, Place] = field(default_factory=dict)

    def of(self, path: Path) -> Place | None:
        """The project of the nearest parent of `path` (or `path` itself) that has a project.toml; None: of none."""
        start = path.absolute()
        root = next((p for p in (start, *start.parents) if (p / PROJECT_FILE).is_file()), None)
        if root is None:
            return None
        if root not in self.known:
            self.known[root] = _load(root)
        return self.known[root]


def _load(root: Path) -> Place:
    try:
        project = Project.find(root)
    except R2S2RError as error:
        return Place(root, problem=error)
    try:
        return Place(root, project, project.robot())
    except R2S2RError as error:
        return Place(root, project, problem=error)


def files_of(place: Place, iteration: int | None = None) -> list[Path]:
    """Every file of a project that can be checked, in the order of the data; or those of one iteration."""
    folder = place.root / ITERATIONS
    if iteration is not None:
        if place.project is None:
            raise place.problem or UsageError("there is no project", hint="r2s2r init myrobot")
        own = place.project.iteration(iteration).path
        return [p for p in (own / CONFIG_FILE, *_artifacts(own)) if p.is_file()]
    robot = place.project.robot_path if place.project else place.root / ROBOT_FILE
    found = [place.root / PROJECT_FILE, robot, *_policies(place.root), *_artifacts(place.root)]
    for path in sorted(folder.glob("*/")):
        found += [p for p in (path / CONFIG_FILE,) if p.is_file()] + _artifacts(path)
    return list(dict.fromkeys(found))


def journals_of(place: Place) -> Journals:
    """The recordings of a project that were cut off; one that is running is none of them."""
    journals = sorted((place.root / ITERATIONS).glob(f"*/*{JOURNAL_SUFFIX}"))
    return Journals(tuple(shown(path) for path in journals if not _running(path)))


def _running(journal: Path) -> bool:
    try:
        with unwatched(journal):
            return False
    except UsageError:
        return True
    except ArtifactError:
        return False


def _artifacts(folder: Path) -> list[Path]:
    return sorted(p for p in folder.glob("*.h5") if not p.name.startswith("."))


def _policies(root: Path) -> list[Path]:
    """TOML files of the project directory that have steps: policies, whether right or wrong."""
    named = {PROJECT_FILE, ROBOT_FILE}
    candidates = [p for p in (*root.glob("*.toml"), *root.glob("policies/*.toml")) if p.name not in named]
    return sorted(p for p in candidates if p.is_file() and _has_steps(p))


def _has_steps(path: Path) -> bool:
    try:
        return b"steps" in path.read_bytes()
    except OSError:
        return True  # reported as a file that cannot be read, rather than passed over


def shown(path: Path) -> str:
    """A path as it can be pasted where the command runs: relative below the working directory, else absolute."""
    absolute = path.absolute()
    return os.path.relpath(absolute) if absolute.is_relative_to(Path.cwd()) else str(absolute)
