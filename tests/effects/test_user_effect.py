"""A law that a user writes: one effect with every hook and memory of its own, defined in this file only, traces,
compiles, and is the same in machine code and in torch."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect, EffectParameter, with_off_values
from r2s2r_cli.engine import Channel, LatchedPid, Parameters, Simulator, Structure, closed_loop
from r2s2r_cli.engine.hooks import CableTerms, ContactTerms, MotorTerms, Values, WorldTerms
from r2s2r_cli.engine.trace_key import trace_key
from tests.support import parity
from tests.support.phases import STEP, expanded, phases
from tests.support.variants import Variant, pair, shifted, with_memory


class Everything(Effect):
    """Every hook once: a filtered command, a motor that heats up, cables that creep, friction that falls with speed,
    drag and a torque, a heavier rod, sensors with an offset, a slow camera. Off: all numbers 0."""

    name = "everything"
    channel = Channel.COMMAND
    title = "every hook once"
    own = (
        EffectParameter("filter_s", "s", 0.0, 0.1, off=0.0, scale=0.02, what="time constant of the command"),
        EffectParameter("heat", "1/(N m)", 0.0, 5.0, off=0.0, scale=2.0, what="speed lost with work", per="actuated"),
        EffectParameter("creep", "1/s", 0.0, 5.0, off=0.0, scale=2.0, what="stretch forgotten", per="cable"),
        EffectParameter("stribeck", "1", -0.5, 1.0, off=0.0, scale=0.3, what="friction at rest beyond sliding"),
        EffectParameter("drag", "N s/m", 0.0, 2.0, off=0.0, scale=0.5, what="force per velocity", per="rod"),
        EffectParameter("load", "1", 0.0, 0.5, off=0.0, scale=0.1, what="added mass", per="rod"),
        EffectParameter("offset_m", "m", -0.01, 0.01, off=0.0, scale=0.002, what="of the sensors", per="cable"),
        EffectParameter("shutter_s", "s", 0.0, 0.1, off=0.0, scale=0.02, what="delay of the camera"),
    )

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "all at once"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Filtered command, work done by each winch [N m], stretch forgotten by each cable [m]."""
        return {"command": structure.n_actuated, "work": structure.n_actuated, "forgotten": structure.n_cables}

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Rods with a load at their centre of mass."""
        return replace(theta, mass=theta.mass * (1.0 + x["load"]))

    def command(self, x: Values, z: Values, u: Tensor, h: Tensor) -> tuple[Tensor, Values]:
        """First-order filter, implicit in the step."""
        filtered = u + (z["command"] - u) * (x["filter_s"] / (x["filter_s"] + h))
        return filtered, {**z, "command": filtered}

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Slower by the work done so far."""
        work = z["work"] + h * torch.abs(rate) * terms.tension
        return rate / (1.0 + x["heat"] * z["work"]), {**z, "work": work}

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """A share of the stretch is forgotten with time."""
        taut = torch.relu(terms.stretch)
        share = torch.where(taut > 0, z["forgotten"] / torch.where(taut > 0, taut, torch.ones_like(taut)), 0.0)
        forgotten = z["forgotten"] + h * x["creep"] * (taut - z["forgotten"])
        return terms.force * (1.0 - torch.clamp(share, 0.0, 1.0)), {**z, "forgotten": forgotten}

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """More friction for slow caps, and a rough spot around the origin."""
        speed = (terms.v_GC[..., :2] ** 2).sum(-1)
        near = torch.exp(-(terms.p_GC[..., :2] ** 2).sum(-1) / 0.01)
        return friction * (1.0 + x["stribeck"][..., None] * (torch.exp(-speed / 0.01) + near))

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Drag, and a torque that turns upright rods."""
        c = x["drag"][..., None]
        return force - c * terms.v_GB, torque - 1e-3 * c * (terms.w_R + terms.R_GR[..., 2, :])

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """An offset of every sensor."""
        return length + x["offset_m"]

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """Each frame shows what was `shutter_s` earlier, between frames in proportion."""
        velocity = torch.diff(p_WE, dim=1) / torch.diff(t)[:, None, None]
        velocity = torch.cat([torch.zeros_like(velocity[:, :1]), velocity], dim=1)
        return p_WE - x["shutter_s"][..., None, None] * velocity


EFFECT = Everything()


@pytest.fixture(scope="module")
def plain() -> Variant:
    """Two rods and three cables, one of them winched."""
    return pair(rod_contact=False)


@pytest.fixture(scope="module")
def model(plain: Variant) -> Variant:
    """The same with the effect, all its numbers on."""
    structure = plain.structure.with_effects(EFFECT)
    theta = with_off_values(structure, plain.theta)
    return Variant(structure, theta.with_values(shifted(structure, theta, EFFECT)), with_memory(structure, plain.start))


@pytest.fixture(scope="module")
def simulator(model: Variant, tmp_path_factory: pytest.TempPathFactory) -> Simulator:
    """Machine code of the effect, kept on disk."""
    return Simulator(model.structure, cache_dir=tmp_path_factory.mktemp("kernels"))


def test_one_step_is_that_of_torch(model: Variant, simulator: Simulator) -> None:
    """In every phase of motion: the state and the whole Jacobian, by both kernels, memories and numbers included."""
    _, states = phases(model, simulator, 6)
    problem, kernels = parity.problem(model, states), simulator.kernels
    native, reference = parity.native_step(kernels, problem, STEP), parity.torch_step(kernels, problem, STEP)
    assert float(parity.value_error(problem, native, reference).max()) < 1e-10
    jacobian = parity.torch_jacobian(kernels, problem, STEP)
    for found in (parity.vjp_jacobian(kernels, problem, STEP), parity.jvp_jacobian(kernels, problem, STEP)):
        assert float(parity.jacobian_error(problem, found, jacobian).max()) < 1e-10
        assert float(parity.jacobian_error(problem, found, jacobian, floor=1e-4).max()) < 1e-6


def test_every_number_of_the_step_matters(model: Variant, simulator: Simulator) -> None:
    """No hook is dead: each own parameter and each memory changes the next state, the sensors and the camera apart."""
    _, states = phases(model, simulator, 6)
    problem = parity.problem(model, states)
    jacobian = parity.jvp_jacobian(simulator.kernels, problem, STEP).abs().amax((0, 1))
    seen = {name: float(jacobian[slot.start : slot.start + slot.size].max())
            for name, slot in problem.inputs().items() if "everything." in name}  # fmt: skip
    for name in ("offset_m", "shutter_s"):
        assert seen.pop(f"everything.{name}") == 0.0
    assert set(seen) == {
        *(f"everything.{name}" for name in ("filter_s", "heat", "creep", "stribeck", "drag", "load")),
        *(f"state.everything.{name}" for name in ("command", "work", "forgotten")),
    }
    assert min(seen.values()) > 1e-9, seen


def test_its_memory_goes_through_a_rollout(model: Variant, simulator: Simulator) -> None:
    """80 ms in flight: machine code and torch end in the same state, memories included, and these have grown."""
    start = replace(model.start, v_WB=model.start.v_WB + model.start.v_WB.new_tensor([0.3, 0.0, 1.0]))
    commands = torch.tensor([[[1.0], [-1.0]]], dtype=torch.float64)
    runs = [
        made.rollout(model.theta, start, commands, step=STEP, hold=40, every=80).at(-1)
        for made in (simulator, Simulator(model.structure, native=False))
    ]
    for name in ("everything.command", "everything.work", "everything.forgotten"):
        assert float(runs[0].extra[name].abs().max()) > 1e-6, name
        assert torch.allclose(runs[0].extra[name], runs[1].extra[name], rtol=1e-9, atol=1e-12)
    assert torch.allclose(runs[0].p_WB, runs[1].p_WB, rtol=0, atol=1e-11)


def test_off_it_is_not_there(plain: Variant, model: Variant, simulator: Simulator) -> None:
    """With all its numbers at their off values and no memory, machine code takes the nominal step to 1e-12."""
    bare = Simulator(plain.structure)
    _, states = phases(plain, bare, 6)
    memory = with_memory(model.structure, expanded(plain.start, len(states.p_WB))).extra
    off = Variant(model.structure, with_off_values(model.structure, plain.theta), model.start)
    nominal = parity.problem(plain, states)
    before = parity.native_step(bare.kernels, nominal, STEP)
    now = parity.native_step(simulator.kernels, parity.problem(off, replace(states, extra=memory)), STEP)
    assert float(parity.value_error(nominal, now[:, : before.shape[1]], before).max()) < 1e-12


def test_the_controller_reads_what_the_sensors_say(model: Variant, simulator: Simulator) -> None:
    """In closed loop the lengths are those of the caps plus the effect's offset."""
    pid = LatchedPid(p=6.0, i=0.01, d=0.5, tolerance=0.1, min_length=0.1, range=0.1, period=0.01,
                     cable_caps=((1, 3), (0, 2), (1, 2)), actuated=(1,))  # fmt: skip
    column = model.start.p_WB.new_zeros(1)
    out = closed_loop(simulator, model.theta, model.start, pid, column[:, None], column, column + 0.05)
    p_WE = out.trajectory.end_caps()[:, :-1]
    ends = torch.tensor(pid.cable_caps)
    lengths = torch.linalg.vector_norm(p_WE[..., ends[:, 1], :] - p_WE[..., ends[:, 0], :], dim=-1)
    offset = model.theta.extra["everything.offset_m"]
    assert float(offset.abs().min()) > 1e-4
    assert torch.allclose(out.length, lengths + offset, rtol=0, atol=1e-12)


def test_the_camera_sees_what_it_says(model: Variant) -> None:
    """The observation hook on a trajectory: a point at constant speed is seen where it was the delay earlier."""
    t = torch.linspace(0.0, 0.3, 7, dtype=torch.float64)
    p_WE = t[None, :, None, None] * torch.ones(1, 7, 4, 3, dtype=torch.float64)
    x = model.theta.of("everything")
    seen = EFFECT.observation(x, t, p_WE)
    assert torch.allclose(seen[:, 1:], p_WE[:, 1:] - x["shutter_s"], rtol=0, atol=1e-12)


def test_its_source_is_part_of_the_key(model: Variant, plain: Variant, tmp_path: Path) -> None:
    """Machine code on disk is bound to the text of the effect: another text is another key."""
    key = trace_key(model.structure)
    assert key != trace_key(plain.structure)
    made = {}
    for scale in ("1.0", "2.0"):
        path = tmp_path / f"law_{scale[0]}.py"
        path.write_text(
            "from r2s2r_cli.engine.hooks import Hooks\n\n\nclass Law(Hooks):\n    name = 'law'\n\n"
            "    def __repr__(self):\n        return 'Law()'\n\n"
            f"    def contact(self, x, terms, friction):\n        return {scale} * friction\n"
        )
        made[scale] = trace_key(plain.structure.with_effects(_loaded(path).Law()))
    assert len({key, *made.values()}) == 3


@pytest.mark.parametrize(
    ("top", "inside", "scaled"),
    [
        ("from formula import share", "", "share(friction)"),
        ("import formula", "", "formula.share(friction)"),
        ("from formula import SCALE", "", "SCALE * friction"),
        ("", "from formula import SCALE", "SCALE * friction"),
    ],
)
def test_what_its_law_takes_from_a_file_beside_it_is_part_of_the_key(
    plain: Variant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, top: str, inside: str, scaled: str
) -> None:
    """The same class with a formula or a constant beside it that was changed is another law, wherever it is imported;
    with another neighbour the same."""
    monkeypatch.syspath_prepend(str(tmp_path))
    keys = []
    for scale, more in (("1.0", ""), ("2.0", ""), ("2.0", "unused = 1\n")):
        (tmp_path / "formula.py").write_text(f"SCALE = {scale}\n\n\ndef share(x):\n    return SCALE * x\n")
        (tmp_path / "neighbour.py").write_text(more)
        (tmp_path / "lawful.py").write_text(
            f"from r2s2r_cli.engine.hooks import Hooks\n{top}\n\n\nclass Law(Hooks):\n    name = 'law'\n\n"
            "    def __repr__(self):\n        return 'Law()'\n\n"
            f"    def contact(self, x, terms, friction):\n        {inside or 'pass'}\n        return {scaled}\n"
        )
        for name in ("formula", "lawful"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        keys.append(trace_key(plain.structure.with_effects(importlib.import_module("lawful").Law())))
    assert keys[0] != keys[1] == keys[2]


def test_what_its_package_keeps_elsewhere_is_part_of_the_key(
    plain: Variant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A law in a package of packages, whose constant comes through a relative import of a module that imports another;
    what nobody imports does not count."""
    monkeypatch.syspath_prepend(str(tmp_path))
    top = tmp_path / "labwork"
    (top / "laws").mkdir(parents=True)
    (top / "common").mkdir()
    for folder in (top, top / "laws", top / "common"):
        (folder / "__init__.py").write_text("")
    (top / "common" / "shared.py").write_text("from labwork.numbers_of import SCALE\n")
    (top / "laws" / "law.py").write_text(
        "from r2s2r_cli.engine.hooks import Hooks\nfrom ..common import shared\n\n\n"
        "class Law(Hooks):\n    name = 'law'\n\n"
        "    def __repr__(self):\n        return 'Law()'\n\n"
        "    def contact(self, x, terms, friction):\n        return shared.SCALE * friction\n"
    )
    keys = []
    for scale, more in (("1.0", ""), ("2.0", ""), ("2.0", "unused = 1\n")):
        (top / "numbers_of.py").write_text(f"SCALE = {scale}\n")
        (top / "laws" / "other.py").write_text(more)
        for name in [name for name in sys.modules if name.partition(".")[0] == "labwork"]:
            sys.modules.pop(name)
        importlib.invalidate_caches()
        keys.append(trace_key(plain.structure.with_effects(importlib.import_module("labwork.laws.law").Law())))
    assert keys[0] != keys[1] == keys[2]


def test_a_law_in_the_init_of_a_package_and_a_neighbour_that_is_no_python(
    plain: Variant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the package imports of itself by its full name counts; where that cannot be read any more nobody can tell
    whether it is the same law, so every key is new."""
    monkeypatch.syspath_prepend(str(tmp_path))
    top = tmp_path / "initlaws"
    top.mkdir()
    (top / "formula.py").write_text("SCALE = 1.0\n")
    (top / "__init__.py").write_text(
        "from r2s2r_cli.engine.hooks import Hooks\nfrom initlaws.formula import SCALE\n\n\n"
        "class Law(Hooks):\n    name = 'law'\n\n    def __repr__(self):\n        return 'Law()'\n\n"
        "    def contact(self, x, terms, friction):\n        return SCALE * friction\n"
    )
    importlib.invalidate_caches()
    structure = plain.structure.with_effects(importlib.import_module("initlaws").Law())
    first = trace_key(structure)
    assert trace_key(structure) == first
    (top / "formula.py").write_text("SCALE = 2.0\n")
    assert trace_key(structure) != first
    (top / "formula.py").write_text("SCALE = (\n")
    assert trace_key(structure) != trace_key(structure)


def _loaded(path: Path) -> object:
    import importlib.util
    import sys

    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # where `inspect` finds a class's file
    spec.loader.exec_module(module)
    return module
