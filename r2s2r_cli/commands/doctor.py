"""`r2s2r doctor`: does this machine have what r2s2r needs, and if not, what to install."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli import __version__
from r2s2r_cli.commands.doctor_camera import camera
from r2s2r_cli.commands.doctor_ports import NO_PORTS, ports
from r2s2r_cli.console import Console
from r2s2r_cli.errors import GateError, R2S2RError, install_extra, quoted
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from schemas.results import DoctorResult, Probe

OPEN3D_NEEDS = "libusb-1.0-0 libgl1 libegl1 libx11-6 libudev1 libidn2-0 libgomp1"
"""Debian's packages of what open3d loads, as in README.md and .ci/system-libs."""
LIBRARIES: dict[str, tuple[str, str]] = {
    "h5py": ("error", "pip install --force-reinstall h5py"),
    "torch": ("error", "pip install torch==2.13.0"),
    "cv2": ("error", "pip install --force-reinstall opencv-python-headless"),
    "serial": ("error", "pip install --force-reinstall pyserial"),
    "mujoco": ("warning", install_extra("rig")),
    "open3d": ("warning", "sudo apt-get install " + OPEN3D_NEEDS),
}
"""What is imported, in a process of its own; what its failure means; the remedy."""
IMPORT_LIMIT_S = 60
MIN_FREE_BYTES = 1 << 30


doctor_app = typer.Typer(invoke_without_command=True)


@doctor_app.callback(invoke_without_command=True)
def doctor(
    context: typer.Context,
    quick: Annotated[bool, typer.Option("--quick", help="Versions and paths only; import no library.")] = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Check this machine: versions, libraries (each imported in a process of its own), disk, the project, serial ports.

    `doctor ports PORT` looks at the robot on a port, `doctor camera` through a camera.

    Example: r2s2r doctor
    """
    if context.invoked_subcommand is not None:
        return
    console = Console(json=json, quiet=quiet)
    probes = [*_installation(), *_place(project)]
    if not quick:
        probes += _outlets()
        with console.progress("libraries", len(LIBRARIES)) as advance:
            for name, (state, hint) in LIBRARIES.items():
                probes.append(_library(name, state, hint))
                advance(1)
        probes.append(_hdf5())
    console.document(DoctorResult(probes=tuple(probes)))
    console.table("", ["what", "state", "found"], [[p.name, p.state, p.found] for p in probes])
    for probe in probes:
        if probe.hint:
            console.hint(probe.hint)
    failed = [p for p in probes if p.state == "error"]
    if failed:
        raise GateError(f"{len(failed)} things are missing", where=failed[0].name, expected="working",
                        received=failed[0].found, hint=failed[0].hint)  # fmt: skip


def _installation() -> Iterator[Probe]:
    from r2s2r_cli.store.provenance import package_versions, source_commit

    ours = (3, 11) <= sys.version_info < (3, 13)  # as pyproject.toml says
    yield Probe(name="python", state="ok" if ours else "error", found=platform.python_version(),
                hint="" if ours else "install Python 3.11 or 3.12")  # fmt: skip
    commit, dirty = source_commit()
    origin = f"checkout {commit[:12]}{' (dirty)' if dirty else ''}" if commit else "installed package"
    yield Probe(name="r2s2r", state="ok", found=f"{__version__}, {origin}")
    yield _schemas()
    for name, version in package_versions().items():
        if name not in ("python", "r2s2r"):
            yield Probe(name=name, state="ok", found=version)


def _schemas() -> Probe:
    """`schemas` is a generic name: another installed package could shadow ours."""
    import r2s2r_cli
    import schemas

    expected = Path(r2s2r_cli.__file__).resolve().parents[1] / "schemas"
    found = Path(str(schemas.__file__)).resolve().parent
    right = found == expected
    return Probe(name="schemas", state="ok" if right else "error", found=str(found),
                 hint="" if right else f"uninstall the package that provides {found}")  # fmt: skip


def _place(project: Path | None) -> Iterator[Probe]:
    from r2s2r_cli.store.project import Project

    try:
        here = Project.find(project)
        here.robot()
        root, found = here.root, f"{here.root} (robot {here.robot().name}, {len(here.iterations())} iterations)"
        yield Probe(name="project", state="ok", found=found)
    except R2S2RError as error:
        root = (project or Path.cwd()).absolute()
        yield Probe(name="project", state="warning", found=error.what, hint=error.hint)
    free = shutil.disk_usage(root if root.is_dir() else Path.cwd()).free
    enough = free > MIN_FREE_BYTES
    yield Probe(name="disk", state="ok" if enough else "warning", found=f"{free / 1e9:.1f} GB free",
                hint="" if enough else f"df -h {quoted(root)}")  # fmt: skip


def _outlets() -> Iterator[Probe]:
    """Serial ports, and what can read a RealSense camera; the rig and TCP or UDP robots need neither. Whether there is
    a camera is not looked at: that takes seconds and switches it on."""
    from importlib.util import find_spec

    from r2s2r_cli.commands.doctor_ports import machine

    for probe in machine():
        yield probe.model_copy(update={"state": "ok", "hint": ""}) if probe.name == NO_PORTS else probe
    modules = (("realsense", "pyrealsense2"), ("open3d", "open3d"))
    ways = [f"--camera {way}" for way, module in modules if find_spec(module)]
    yield Probe(name="RealSense drivers", state="ok",
                found=f"{' or '.join(ways)}; r2s2r doctor camera looks for one" if ways else
                "neither pyrealsense2 nor open3d is installed")  # fmt: skip


def _library(name: str, failed_state: str, hint: str) -> Probe:
    code = f"import time; t = time.time(); import {name}; print(f'{{time.time() - t:.1f}} s')"
    works, said = _tried(code)
    failure = "" if works else said
    found = failure or f"imports in {said}"
    return Probe.model_validate(
        {"name": f"import {name}", "state": failed_state if failure else "ok", "found": found[:200],
         "hint": hint if failure else ""}
    )  # fmt: skip


def _hdf5() -> Probe:
    """Write and read an HDF5 file where temp files go, in a process of its own."""
    code = (
        "import h5py, tempfile, os; d = tempfile.mkdtemp(); p = os.path.join(d, 'x.h5');"
        "f = h5py.File(p, 'w'); f['x'] = [1, 2]; f.close();"
        "f = h5py.File(p, 'r', locking=False); assert f['x'][1] == 2; f.close();"
        "os.unlink(p); os.rmdir(d); print(h5py.version.hdf5_version)"
    )
    works, said = _tried(code)
    return Probe(name="HDF5 write and read", state="ok" if works else "error", found=said[:200],
                 hint="" if works else "pip install --force-reinstall h5py")  # fmt: skip


def _tried(code: str) -> tuple[bool, str]:
    """Whether Python code ran to its end in a process of its own, and the last line of what it said."""
    try:
        child = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=IMPORT_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return False, f"it took over {IMPORT_LIMIT_S} s"
    works = child.returncode == 0
    return works, ((child.stdout if works else child.stderr).strip().splitlines() or ["it crashed"])[-1]


doctor_app.command("ports")(ports)
doctor_app.command("camera")(camera)
