"""No malformed input passes, and none ends in anything but an error that says what, where and what to do."""

from __future__ import annotations

import json

import pytest

from r2s2r_cli.errors import ExitCode, InputError
from r2s2r_cli.stages.import_.authors_json import parse_frame
from r2s2r_cli.stages.import_.sidecar import check_sidecar, parse_sidecar
from r2s2r_cli.stages.import_.trajectory import import_trajectory
from tests.support.import_samples import SIDECAR, frame_json, sample_robot, small_csv
from tests.support.malformed import Malformed, json_cases, mutated, sidecar_cases
from tests.support.malformed_csv import csv_cases

ROBOT = sample_robot()
GOOD_JSON = json.dumps(frame_json()).encode()


def read_csv(data: bytes) -> None:
    """Import a CSV with the good sidecar."""
    import_trajectory(data, "log", robot=ROBOT, sidecar=parse_sidecar(SIDECAR.encode(), "log.toml"), where="log.csv")


def read_sidecar(data: bytes) -> None:
    """Parse a sidecar and compare its robot."""
    check_sidecar(parse_sidecar(data, "log.toml"), ROBOT, "log.toml")


def read_json(data: bytes) -> None:
    """Parse one frame."""
    parse_frame(data, "data/0000.json")


CASES = [
    pytest.param(read, case, id=f"{kind}-{case.name}")
    for kind, read, cases in (
        ("csv", read_csv, csv_cases()),
        ("toml", read_sidecar, sidecar_cases()),
        ("json", read_json, json_cases()),
    )
    for case in cases
]


@pytest.mark.parametrize(("read", "case"), CASES)
def test_malformed_input_is_refused_with_place_and_hint(read, case: Malformed) -> None:  # type: ignore[no-untyped-def]
    """Every malformed input ends in InputError (exit code 4) with place and hint; the documented few are read."""
    if case.accepted:
        read(case.data)
        return
    with pytest.raises(InputError) as caught:
        read(case.data)
    error = caught.value
    assert error.exit_code == ExitCode.INPUT
    assert error.where.startswith(("log.csv", "log.toml", "data/0000.json"))
    assert error.hint
    assert not error.what.endswith(".")
    assert str(error).replace("\n", "").isprintable()
    assert len(str(error)) < 2000


@pytest.mark.parametrize("block", range(4))
@pytest.mark.parametrize(
    ("read", "good"),
    [
        (read_csv, small_csv().encode()),
        (read_sidecar, SIDECAR.encode()),
        (read_json, json.dumps(frame_json()).encode()),
    ],
    ids=["csv", "toml", "json"],
)
def test_random_damage_never_ends_in_a_traceback(read, good: bytes, block: int) -> None:  # type: ignore[no-untyped-def]
    """100 randomly damaged inputs a block are read, or refused with a printable message; nothing else happens."""
    refused = 0
    for seed in range(100 * block, 100 * block + 100):
        try:
            read(mutated(good, seed))
        except InputError as error:
            refused += 1
            assert error.hint and str(error).replace("\n", "").isprintable()
    assert refused > 50


def test_there_are_two_hundred_cases_and_no_two_alike() -> None:
    """The list is long, its names are unique within a kind, and making it twice gives the same bytes."""
    for cases in (csv_cases, sidecar_cases, json_cases):
        names = [case.name for case in cases()]
        assert len(set(names)) == len(names)
        assert cases() == cases()
        assert sum(not case.accepted for case in cases()) >= 60
    assert len(CASES) >= 200
