"""The world file: what it may say, what it is told when it may not, and that every key is documented."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.effects.base import EffectSection
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.world import World, load_world
from r2s2r_cli.rig.world.faults import Fault
from r2s2r_cli.rig.world.page import EXAMPLE, documented, undocumented, world_page

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "world.md"


def load(tmp_path: Path, text: str) -> World:
    """A world file with this text."""
    path = tmp_path / "w.toml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def test_an_empty_file_is_a_world(tmp_path: Path) -> None:
    """Everything has a default, and by default no effect holds, nothing breaks and the wire is clean."""
    world = load(tmp_path, "")
    assert world == World()
    assert list(world.effects.present()) == []
    assert world.faults == ()
    assert max(world.wire.model_dump(exclude={"pause_s"}).values()) == 0


def test_the_example_of_the_page_is_read(tmp_path: Path) -> None:
    """The page's own example loads, and says what it says."""
    world = load(tmp_path, EXAMPLE)
    assert world.seed == 7
    assert [name for name, _ in world.effects.present()] == ["motor_lag", "friction_field"]
    assert world.faults[0].on(24.9)
    assert not world.faults[0].on(25.0)
    assert EXAMPLE in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("sed = 1", "sed"),
        ("seed = 1.5", "seed"),
        ("seed = -1", "seed"),
        ("[floor]\nfriction = -0.1", "floor.friction"),
        ('[floor]\nfriction = "0.5"', "floor.friction"),
        ("[effects.motor_lagg]", "effects.motor_lagg"),
        ("[effects.motor_lag]\ntau_s = 0.1", "effects.motor_lag.tau_s"),
        ("[effects.motor_dead_zone]\nstart = 1.2", "effects.motor_dead_zone.start"),
        ("[effects.payload]\nmass_kg = 0.1", "effects.payload.rod"),
        ('[[faults]]\nkind = "earthquake"\nat_s = 1.0', "faults.0"),
        ('[[faults]]\nkind = "motor_dead"\nat_s = 1.0', "faults.0.motor_dead.motor"),
        ("[effects.com_offset]\nrod = 0\nby_m = [0.0, 0.0, 20.0]", "effects.com_offset.by_m.2"),
        ("[effects.ground_slope]\nangle_x_rad = 3.0", "effects.ground_slope.angle_x_rad"),
        ("[effects.camera_delay]\ndelay_s = 80.0", "effects.camera_delay.delay_s"),
        ('[boards]\nlayout = "two"', "boards.layout"),
        ("[boards]\nrate_spread = 0.4", "boards.rate_spread"),
        ("[floor]\nrestitution = 1.5", "floor.restitution"),
        ("[effects.obstacle]\nfrom_m = [200.0, -500.0]", "effects.obstacle.from_m.0"),
        ("[effects.obstacle]\nfrom_m = [0.2, 0.1]\nto_m = [0.2, 0.1]", "effects.obstacle"),
        ("[wire]\nlost = 2.0", "wire.lost"),
        ("[start]\nposition_m = [1.0]", "start.position_m"),
        ("[sensors]\nlag_s = nan", "sensors.lag_s"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path: Path, text: str, where: str) -> None:
    """Exit code 4, and the message names the file and the key."""
    with pytest.raises(InputError) as error:
        load(tmp_path, text)
    assert where in error.value.where
    assert "w.toml" in error.value.where
    assert error.value.exit_code == 4


@pytest.mark.parametrize("text", ["seed = ", "\x00", "[a\nb"])
def test_what_is_no_toml_is_said_to_be_none(tmp_path: Path, text: str) -> None:
    """A damaged file is one clear error, and so is a missing one."""
    with pytest.raises(InputError, match="no TOML"):
        load(tmp_path, text)
    with pytest.raises(InputError, match="cannot be read"):
        load_world(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_said_to_be_none(tmp_path: Path) -> None:
    """Bytes that are no UTF-8 are no TOML."""
    (tmp_path / "w.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no TOML"):
        load_world(tmp_path / "w.toml")


def test_the_committed_page_is_the_present_one() -> None:
    """docs/reference/world.md is what `make docs` would write."""
    assert PAGE.read_text(encoding="utf-8").endswith("\n\n" + world_page())


def test_every_key_is_on_the_page() -> None:
    """Each table has its heading, each key its row, each fault its section."""
    page = world_page()
    for table, key in documented():
        part = page.split(f" `[{table}]`\n" if table else "## The file itself\n", 1)[1].split("\n#", 1)[0]
        assert f"| `{key}` |" in part, (table, key)
    for kind in get_args(get_args(Fault)[0]):
        assert f'### kind = "{get_args(kind.model_fields["kind"].annotation)[0]}"' in page


def test_every_key_says_what_it_is() -> None:
    """No key of the world file is without a text (those of the camera are its own affair)."""
    assert [f"{table}.{key}" for table, key in undocumented() if not table.startswith("camera")] == []


def test_every_effect_says_what_it_is_and_how_it_is_done() -> None:
    """A docstring for the effect, and one for the way in which it acts."""
    for field in Effects.model_fields.values():
        (section,) = (kind for kind in get_args(field.annotation) if kind is not type(None))
        assert issubclass(section, EffectSection)
        assert section.__doc__
        acts = [section.__dict__[hook] for hook in ("law", "options", "seen") if hook in section.__dict__]
        assert acts
        assert all(hook.__doc__ for hook in acts)
