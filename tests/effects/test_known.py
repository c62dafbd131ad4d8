"""Effects that installed packages bring: the worked example of the documentation, and packages that are wrong."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import known_effects
from r2s2r_cli.effects.known import loaded
from r2s2r_cli.effects.words import page
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.errors import InputError
from r2s2r_cli.installed import GROUP
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.effects import all_effects
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.effects_asked import effects_asked
from r2s2r_cli.stages.identify.free.catalogue import catalogue
from r2s2r_cli.stages.identify.free.mapping import Mapping
from r2s2r_cli.stages.identify.free.select import select
from tests.support.engine import MASS, G, free_rods, parameters, roll, state, threebar, vector

GUIDE = Path(__file__).parents[2] / "docs" / "how-to-extend.md"

Install = Callable[[str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Puts a module and its entry point where an installed package would be."""

    def made(source: str, entry: str) -> None:
        module = re.search(r"= (\w+):", entry)[1]  # type: ignore[index]
        (tmp_path / f"{module}.py").write_text(source)
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir(exist_ok=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{entry}\n")
        monkeypatch.syspath_prepend(str(tmp_path))
        known_effects.cache_clear()

    yield made
    monkeypatch.undo()
    known_effects.cache_clear()


def example() -> str:
    """The module of the guide."""
    return re.search(r"### In a package of your own.*?```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)[1]  # type: ignore[index]


def test_the_guides_example_is_an_effect_like_any_other(install: Install) -> None:
    """It is found, free like the others with and without `--with-effect`, diagnosed, explained, and does what it says:
    F / m on every rod; off it is nothing."""
    install(example(), "side_wind = wind_of_the_guide:SideWind")
    effect = known_effects()[-1]
    assert effect.name == "side_wind"
    assert "side_wind.force_n" in catalogue(threebar())
    asked = effects_asked(["side_wind"], threebar())
    fitted = Mapping(threebar(), select(asked.specs, threebar(), asked.ids), asked.ids)
    assert fitted.names == ("side_wind.force_n",)
    assert [one.name for one in fitted.structure.effects] == ["side_wind"]
    assert "side_wind" in {one.name for one in Model(nominal(threebar())).effects}
    assert "- *Source*: statics." in page([effect], ())
    structure = free_rods(2, rod_contact=False).with_effects(effect)
    start = state(structure, torch.stack([vector(0.0, 0.0, 1.0), vector(0.0, 1.0, 1.0)]))
    bare = parameters(free_rods(2, rod_contact=False))
    for force in (0.26, 0.0):
        theta = bare.with_values({"side_wind.force_n": torch.full((1, 1), force, dtype=torch.float64)})
        after = roll(structure, theta, start, 1, 1e-3)[-1].v_WB[0]
        expected = vector(force / 2 / MASS, 0.0, -G) * 1e-3
        assert torch.allclose(after, expected.expand(2, 3), rtol=0, atol=1e-15)
    plain = roll(free_rods(2, rod_contact=False), bare, replace(start, extra={}), 1, 1e-3)[-1]
    assert torch.equal(plain.v_WB[0], after)


@pytest.mark.parametrize("flag", [", only_shape=True", ""])
def test_a_number_that_only_says_how_is_tried_with_a_size(install: Install, flag: str) -> None:
    """Whatever it is called: as it says of itself. A direction that does nothing without a force is never tried without
    one, goes to both sides beside it, and stays where half the force is taken; one that does is tried by itself."""
    made = turned_wind(f', what="from x"{flag}')
    install(made, f"side_wind = wind_with_{'shape' if flag else 'sizes'}:SideWind")
    (one,) = candidates(Model(nominal(threebar()), ("side_wind",)))
    force, angle = one.tries.T
    assert one.shape.tolist() == [False, bool(flag)]
    assert np.all(force != 0) == bool(flag)
    assert {-0.5, 0.0, 0.5} == set(angle[force > 0])
    assert one.share(np.array([0.2, 0.4]), 0.5).tolist() == [0.1, 0.4 if flag else 0.2]


def turned_wind(rest: str) -> str:
    """The guide's wind with a second number, its direction."""
    own = 'what="of the wind, on the whole robot"),'
    assert own in example()
    return example().replace(
        own, f'{own} EffectParameter("angle_rad", "rad", -1.6, 1.6, off=0.0, scale=0.5{rest}),'
    ).replace("[pull, 0.0 * pull,", '[pull * torch.cos(x["angle_rad"]), pull * torch.sin(x["angle_rad"]),')  # fmt: skip


@pytest.mark.parametrize(
    ("source", "entry", "what"),
    [
        ("raise ImportError('gone')", "side_wind = bad_one:SideWind", "cannot be loaded"),
        ("SideWind = 3", "side_wind = bad_two:SideWind", "not an effect"),
        (None, "storm = bad_three:SideWind", "another id"),
        (None, "payload = bad_four:SideWind", "there already"),
        (None, "side_wind = bad_five:SideWind", "only_shape"),
    ],
)
def test_a_wrong_package_is_named(install: Install, source: str | None, entry: str, what: str) -> None:
    """With its entry point, what was expected, and what it is; never a traceback."""
    text = example() if source is None else source
    if entry.startswith("payload"):
        text = text.replace('name = "side_wind"', 'name = "payload"')
    if what == "only_shape":
        text = text.replace("scale=0.1,", "scale=0.1, only_shape=True,")
    install(text, entry)
    with pytest.raises(InputError, match=what) as caught:
        all_effects()
    assert entry.split(" = ")[1] in str(vars(caught.value))
    assert caught.value.hint


def test_a_class_and_an_instance_are_the_same() -> None:
    """An entry point may name either."""
    by_class = loaded(EntryPoint("payload", "r2s2r_cli.effects.payload:Payload", GROUP))
    assert by_class == next(one for one in known_effects() if one.name == "payload")
    with pytest.raises(EngineInputError, match="not an effect"):
        loaded(EntryPoint("payload", "r2s2r_cli.effects.payload:torch", GROUP))
