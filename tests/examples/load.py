"""Modules of an example directory by name, as its own run.py sees them."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType

from tests.guards.listing import ROOT


def load(folder: str, module: str) -> ModuleType:
    """A module of examples/`folder`. `run` is the name of several: it is loaded under a name of its own."""
    path = ROOT / "examples" / folder
    sys.path.insert(0, str(path))
    try:
        if module != "run":
            return importlib.import_module(module)
        spec = importlib.util.spec_from_file_location(f"run_{folder}", path / "run.py")
        assert spec is not None
        assert spec.loader is not None
        found = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = found  # dataclasses look their own module up
        spec.loader.exec_module(found)
        return found
    finally:
        sys.path.remove(str(path))
