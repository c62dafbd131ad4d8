"""Fixtures that every test folder shares."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A loaded machine is slow, which is no fault of the code under test: no test here asserts a time.
settings.register_profile("loaded", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("loaded")

REAL = Path(__file__).resolve().parents[2] / "shared" / "real"


@pytest.fixture(scope="session")
def real_dir() -> Path:
    """Folder of real measurements; skips where it is absent (it may not be copied into the project)."""
    if not REAL.is_dir():
        pytest.skip("the real measurements (../shared/real) are not on this machine")
    return REAL
