"""One file a subcommand. A command is listed here when it works, not before.

The functions are imported when the app is built, so nothing heavy may be imported at the top of any of them.
"""

from __future__ import annotations

from collections.abc import Callable

import typer

from r2s2r_cli.commands.bench import bench_app
from r2s2r_cli.commands.blind import blind_app
from r2s2r_cli.commands.calibrate import calibrate
from r2s2r_cli.commands.compare import compare
from r2s2r_cli.commands.diagnose import diagnose
from r2s2r_cli.commands.doctor import doctor_app
from r2s2r_cli.commands.effects import effects
from r2s2r_cli.commands.estimate import estimate
from r2s2r_cli.commands.execute import execute
from r2s2r_cli.commands.export import export
from r2s2r_cli.commands.floor import floor
from r2s2r_cli.commands.identify import identify
from r2s2r_cli.commands.import_ import import_
from r2s2r_cli.commands.init import init
from r2s2r_cli.commands.inspect import inspect
from r2s2r_cli.commands.migrate import migrate
from r2s2r_cli.commands.plan import plan
from r2s2r_cli.commands.record import record
from r2s2r_cli.commands.recover import recover
from r2s2r_cli.commands.rig import rig
from r2s2r_cli.commands.run import run
from r2s2r_cli.commands.simulate import simulate
from r2s2r_cli.commands.status import status
from r2s2r_cli.commands.validate import validate

COMMANDS: dict[str, Callable[..., None]] = {
    "init": init,
    "calibrate": calibrate,
    "record": record,
    "import": import_,
    "estimate": estimate,
    "identify": identify,
    "plan": plan,
    "execute": execute,
    "compare": compare,
    "diagnose": diagnose,
    "run": run,
    "floor": floor,
    "simulate": simulate,
    "rig": rig,
    "effects": effects,
    "status": status,
    "inspect": inspect,
    "validate": validate,
    "migrate": migrate,
    "recover": recover,
    "export": export,
}
"""Subcommands in the order of the data, then of use."""

GROUPS: dict[str, typer.Typer] = {
    "doctor": doctor_app,
    "bench": bench_app,
    "blind": blind_app,
}
"""Subcommands that have subcommands."""
