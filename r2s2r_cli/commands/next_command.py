"""What to run next in a project where nothing is to be mended."""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.commands.mend import sighted
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Iteration, Project


def forward(project: Project) -> str:
    """The next command where nothing is to be mended."""
    every = project.iterations()
    earlier = any(
        one.artifact("estimate", executed=executed).exists() for one in every[:-1] for executed in (False, True)
    )
    if not every or not (every[-1].artifact("recording").exists() or earlier):
        return project.first_data()
    place = every[-1]
    if not place.artifact("recording").exists():  # it learns from the iteration before
        return _planned(project, place, ("identification", "plan"))
    held = list(read_header(place.artifact("recording")).datasets)
    if not sighted(held):
        # Nothing to estimate states from yet; sensors alone tell how far the robot repeats itself.
        repeats = len({name.split("/")[1] for name in held if name.startswith("runs/")}) > 1
        return "r2s2r floor" if repeats and not project.artifact("floor", None).exists() else ""
    return _planned(project, place, ("estimate", "identification", "plan"))


def _planned(project: Project, place: Iteration, kinds: Sequence[str]) -> str:
    """The next command of an iteration whose robot has done what it can without a plan."""
    for kind in kinds:
        if not place.artifact(kind).exists():
            return f"r2s2r {'identify' if kind == 'identification' else kind} --iteration {place.number}"
    if place.artifact("recording", executed=True).exists():
        if not place.artifact("estimate", executed=True).exists():
            return f"r2s2r estimate --of execute --iteration {place.number}"
        if not place.artifact("comparison").exists():
            return f"r2s2r compare --iteration {place.number}"
    elif _moved_by_us(project):
        return f"r2s2r execute --iteration {place.number} --dry-run"
    elif place.artifact("estimate").exists() and not place.artifact("comparison").exists():
        return f"r2s2r compare --iteration {place.number}"  # a log cannot be asked for more: with what it has
    return ""


def explained(project: Project) -> str:
    """The diagnosis of the last iteration, where it has a simulator and none yet; else empty."""
    places = project.iterations()
    if not places or not places[-1].artifact("identification").exists() or places[-1].artifact("diagnosis").exists():
        return ""
    return f"r2s2r diagnose --iteration {places[-1].number}"


def _moved_by_us(project: Project) -> bool:
    """Whether any run of the project was recorded here: a robot can be asked for more, a log cannot."""
    from r2s2r_cli.measured import MEASURED

    places = project.iterations()
    found = [place.artifact("recording", executed=executed) for place in places for executed in (False, True)]
    return any(path.exists() and read_header(path).provenance.stage in MEASURED for path in found)
