"""Whether a 30-identify.h5 is still a simulator of this project's robot, and which runs it has learned from."""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.commands.wanted import robot_part
from r2s2r_cli.errors import InputError, R2S2RError
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project, iteration_number
from r2s2r_cli.store.staleness import differences, input_reasons
from schemas.header import Header
from schemas.versions import STAGE_VERSIONS


def require_current(project: Project, name: str, path: Path, header: Header) -> list[str]:
    """What is not as it was, in words: inputs that changed since make it no other simulator.

    Raises InputError where it is: its numbers belong to another robot.toml, or to another version of `identify`.
    """
    made = header.provenance
    wrong = [f"robot.toml: {text}" for text in differences(made.robot, robot_part("identify", project.robot()))]
    now = STAGE_VERSIONS["identify"]
    if made.stage_version != now:
        wrong.insert(0, f"made by version {made.stage_version} of identify, this is {now}")
    if wrong:
        number = iteration_number(path.parent)
        raise InputError(
            f"the simulator {name} is stale: its numbers are those of another robot or version",
            where=project.relative(path), expected="an identification with this robot.toml and this r2s2r",
            received="; ".join(wrong[:3]) + (f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""),
            hint="r2s2r identify" + ("" if number is None else f" --iteration {number}"),
        )  # fmt: skip
    if not path.resolve().is_relative_to(project.root.resolve()):
        return []  # of another project: its inputs are not here
    return [text for ref in made.inputs for text in input_reasons(project, ref)]


def learned_names(project: Project, model: Path, header: Header) -> dict[tuple[str, str], str]:
    """What `identify` called the runs of its estimates: by path of the estimate and name of the run there.

    Runs of the main iteration (that of the first input) keep their names, others are called NNN-RUN; a name that is
    taken becomes executed-NAME. An estimate that cannot be read any more is left out. model: the identification's file.
    What one from elsewhere learned from is here only where the recording or the estimate is the same: in another
    project others lie at the same places. In this one what was estimated anew still are the runs it learned from.
    """
    foreign = not model.resolve().is_relative_to(project.root.resolve())
    inputs = header.provenance.inputs
    here = {Path(ref.path).parent for ref in inputs if not foreign or not input_reasons(project, ref)}
    estimates = [ref for ref in inputs if ref.kind == "estimate"]
    found: dict[tuple[str, str], str] = {}
    taken: set[str] = set()
    for ref in estimates:
        path = ref.path
        if Path(path).parent not in here:
            continue
        same = Path(path).parent.name == Path(estimates[0].path).parent.name
        try:
            held = read_header(project.root / path).datasets
        except R2S2RError:
            continue
        for run in dict.fromkeys(name.split("/")[1] for name in held if name.startswith("runs/")):
            name = run if same else f"{Path(path).parent.name}-{run}"
            name = f"executed-{name}" if name in taken else name
            taken.add(name)
            found[path, run] = name
    return found
