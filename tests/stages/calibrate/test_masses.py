"""Rods from weighed parts, against closed forms; damaged mass files."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, strategies as st

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.masses import mass_properties, read_masses
from r2s2r_cli.stages.calibrate.source import Source
from schemas.robot import Lump, Robot


def lump(mass: float, offset: float, shape: Any = "point", **sizes: float) -> Lump:
    """A part with a name that does not matter."""
    return Lump(name="part", mass_kg=mass, offset_m=offset, shape=shape, **sizes)


@given(st.floats(1e-3, 1), st.floats(1e-3, 1), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_two_point_masses(m1: float, m2: float, x1: float, x2: float) -> None:
    """Their inertia is the reduced mass times the squared distance; along the line there is none."""
    found = mass_properties([lump(m1, x1), lump(m2, x2)])
    assert found.mass == pytest.approx(m1 + m2)
    assert found.com == pytest.approx((m1 * x1 + m2 * x2) / (m1 + m2), abs=1e-12)
    assert found.inertia_transverse == pytest.approx(m1 * m2 / (m1 + m2) * (x1 - x2) ** 2, abs=1e-12)
    assert found.inertia_axial == 0.0


@pytest.mark.parametrize("n", [1, 2, 7, 100])
def test_a_rod_cut_into_slices_is_the_rod(n: int) -> None:
    """Slices of a cylinder add up to m (3 r^2 + L^2) / 12 and m r^2 / 2, wherever the cuts are."""
    m, r, length, at = 0.04, 0.01, 0.3, 0.05
    step = length / n
    slices = [lump(m / n, at - length / 2 + (i + 0.5) * step, "cylinder", radius_m=r, length_m=step) for i in range(n)]
    found = mass_properties(slices)
    assert found.mass == pytest.approx(m) and found.com == pytest.approx(at)
    assert found.inertia_axial == pytest.approx(m * r**2 / 2)
    assert found.inertia_transverse == pytest.approx(m * (3 * r**2 + length**2) / 12)


def test_a_tube_is_a_cylinder_less_its_core() -> None:
    """A hollow cylinder equals the full one minus the one that was drilled out, of the same material."""
    r, inner, length, density = 0.0175, 0.009, 0.045, 5000.0
    volume = [3.141592653589793 * x**2 * length for x in (r, inner)]
    full = mass_properties([lump(density * volume[0], 0, "cylinder", radius_m=r, length_m=length)])
    core = mass_properties([lump(density * volume[1], 0, "cylinder", radius_m=inner, length_m=length)])
    tube = mass_properties(
        [lump(density * (volume[0] - volume[1]), 0, "tube", radius_m=r, inner_radius_m=inner, length_m=length)]
    )
    assert tube.inertia_axial == pytest.approx(full.inertia_axial - core.inertia_axial)
    assert tube.inertia_transverse == pytest.approx(full.inertia_transverse - core.inertia_transverse)


def test_a_sphere_is_the_same_in_every_direction() -> None:
    """Two fifths m r^2 about its own centre, also where it sits off the middle."""
    found = mass_properties([lump(0.0105, 0.1625, "sphere", radius_m=0.0175)])
    assert found.inertia_axial == found.inertia_transverse == pytest.approx(0.4 * 0.0105 * 0.0175**2)
    assert found.com == pytest.approx(0.1625)


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_inertia_is_about_the_true_centre_of_mass(shift: float, payload: float) -> None:
    """Moving the whole rod along itself changes the centre of mass and nothing else."""
    parts = [lump(0.03, -0.1, "sphere", radius_m=0.02), lump(0.05, payload, "cylinder", radius_m=0.01, length_m=0.04)]
    moved = [part.model_copy(update={"offset_m": part.offset_m + shift}) for part in parts]
    one, other = mass_properties(parts), mass_properties(moved)
    assert other.com == pytest.approx(one.com + shift, abs=1e-12)
    assert other.inertia_transverse == pytest.approx(one.inertia_transverse, abs=1e-15)


def test_the_rods_of_the_description_weigh_what_the_reference_says(robot: Robot) -> None:
    """The parts in robot.toml of the 3-bar robot add up to 133.4 g a rod, balanced about the middle."""
    for rod in robot.rods:
        found = mass_properties(rod.parts)
        assert found.mass == pytest.approx(0.1334)
        assert found.com == pytest.approx(0.0, abs=1e-12)


PART = """[[part]]
name = "motor"
mass_kg = 0.12
offset_m = 0.0
shape = "tube"
radius_m = 0.0175
length_m = 0.045
inner_radius_m = 0.0016
"""


def read(text: str, robot: Robot) -> dict[str, tuple[Lump, ...]]:
    """The parts of a text."""
    return read_masses(Source("masses.toml", text.encode()), robot)


def test_a_part_without_rod_belongs_to_all(robot: Robot) -> None:
    """Common parts go to every rod, named ones to theirs only; a rod that is not mentioned is not touched."""
    extra = '[[part]]\nrod = "green"\nname = "board"\nmass_kg = 0.03\noffset_m = 0.02\nshape = "point"\n'
    parts = read(PART + extra, robot)
    assert list(parts) == ["red", "green", "blue"]
    assert [len(some) for some in parts.values()] == [1, 2, 1]
    assert list(read(PART.replace("name", 'rod = "blue"\nname'), robot)) == ["blue"]


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("mass_kg = 0.12", "mass_kg = -0.12", "cannot be used"),
        ("mass_kg = 0.12", "mass_kg = 0", "cannot be used"),
        ("mass_kg = 0.12", "mass_kg = nan", "cannot be used"),
        ("mass_kg = 0.12", 'mass_kg = "0.12"', "cannot be used"),
        ("mass_kg = 0.12", "mass_kg = true", "cannot be used"),
        ("mass_kg = 0.12\n", "", "cannot be used"),
        ("mass_kg = 0.12", "mass_g = 120", "did you mean mass_kg"),
        ("mass_kg = 0.12", "mass_kg = 120", "weigh too little or too much"),
        ("offset_m = 0.0", "offset_m = 117.5", "cannot be used"),
        ("offset_m = 0.0", "offset_m = 1.175", "does not lie on the rod"),
        ("length_m = 0.045", "length_m = 45", "cannot be used"),
        ("length_m = 0.045", "length_m = 4.5", "does not lie on the rod"),
        ("length_m = 0.045\n", "", "needs length_m"),
        ('"tube"', '"sphere"', "has no length_m"),
        ('"tube"', '"cylinder"', "has no inner_radius_m"),
        ('"tube"', '"box"', "cannot be used"),
        ("inner_radius_m = 0.0016", "inner_radius_m = 0.02", "wider than its outside"),
        ("[[part]]", "[part]", "not a list of parts"),
        ("[[part]]", "[[parts]]", "not a list of parts"),
        ("[[part]]", "x = 1\n[[part]]", "not a list of parts"),
        ("[[part]]", "[[part]", "not valid TOML"),
        ('name = "motor"', 'name = "motor"\nrod = "rde"', "did you mean red"),
        ('name = "motor"', 'name = "motor"\nrod = 3', "no such rod"),
        (PART, PART + PART, "same name"),
        (PART, "", "not a list of parts"),
        (PART, "part = [1]", "not a table"),
    ],
)
def test_wrong_masses_are_refused(robot: Robot, old: str, new: str, what: str) -> None:
    """Every kind of damage raises InputError with place, expectation and hint."""
    assert old in PART
    with pytest.raises(InputError) as caught:
        read(PART.replace(old, new, 1), robot)
    error = caught.value
    assert what in error.what
    assert error.where.startswith("masses.toml") and error.expected and error.received and error.hint


SECOND = PART.replace("motor", "gear").replace("0.12", "0.02")


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("mass_kg = 0.02", "mass_kg = -0.02", "line 13, part 2, mass_kg"),
        ("offset_m = 0.0", "offset_m = 1.175", "line 14, part 2, offset_m"),
        ("radius_m = 0.0175", "radius_m = 0.4", "line 16, part 2, radius_m"),
        ("length_m = 0.045", "lenght_m = 0.045", "line 17, part 2, lenght_m"),
        ("length_m = 0.045\n", "", "line 11, part 2, length_m"),
        ("inner_radius_m = 0.0016", "inner_radius_m = 0.02", "line 18, part 2, inner_radius_m"),
        ('name = "gear"', 'name = "motor"', "line 12, part 2, name"),
        ("mass_kg = 0.02", "mass_kg = 120", "line 13, part 2, mass_kg"),
    ],
)
def test_the_line_of_the_wrong_key_is_named(robot: Robot, old: str, new: str, place: str) -> None:
    """Of two parts the second is wrong: its own lines are counted, behind a comment and a blank line."""
    text = "# weighed by hand\n" + PART + "\n" + SECOND
    assert set(read(text, robot)) == {"red", "green", "blue"}
    with pytest.raises(InputError) as caught:
        read("# weighed by hand\n" + PART + "\n" + SECOND.replace(old, new, 1), robot)
    assert caught.value.where == f"masses.toml, {place}"


def test_parts_in_one_list_have_numbers_only(robot: Robot) -> None:
    """`part = [{...}]` has no lines to name: the number of the part is the place."""
    with pytest.raises(InputError) as caught:
        read('part = [{name = "a", mass_kg = 0.12, offset_m = 0, shape = "box"}]', robot)
    assert caught.value.where == "masses.toml, part 1, shape"
