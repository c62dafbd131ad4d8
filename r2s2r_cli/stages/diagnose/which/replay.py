"""Many hypotheses through the engine at once: what camera and length sensors would have seen of every stretch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.offsets import displacement_jacobian
from r2s2r_cli.stages.identify.predict import Prediction, Predictor, alike

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters

EVERY = 10
"""Engine steps between stored states."""
MOST = 256
"""Simulations in one batch."""
TINY = 1e-6


@dataclass(frozen=True)
class Seen:
    """Of one stretch, for k hypotheses: caps (k, F, cap, 3) [m], as the camera sees them, and length (k, F, sensor)
    [m], as the sensors read them. What left the finite numbers is nan."""

    caps: np.ndarray
    length: np.ndarray


class Replayer(Predictor):
    """Simulates stretches by command replay, many hypotheses at once; derivatives by where a stretch starts."""

    def __init__(self, model: Model, **how: object) -> None:
        super().__init__(model, **how)  # type: ignore[arg-type]
        self.model = model
        rods, winches = self.structure.n_rods, self.structure.n_actuated
        self.moved = np.r_[np.arange(6 * rods), 12 * rods + np.arange(winches)]
        """Offsets of a start that are free: place, tilt and roll of every rod, rest lengths; not how fast it moves."""

    def seen(self, many: Sequence[Stretch], values: np.ndarray) -> list[Seen]:
        """Of every stretch at values (k, n)."""
        parts: dict[int, Seen] = {}
        for group in alike([one.window for one in many]):
            together = max(1, MOST // len(group))
            chunks = [
                self._batch([many[k] for k in group], values[first : first + together])
                for first in range(0, len(values), together)
            ]
            for i, k in enumerate(group):
                parts[k] = Seen(
                    np.concatenate([chunk[i].caps for chunk in chunks]),
                    np.concatenate([chunk[i].length for chunk in chunks]),
                )
        return [parts[k] for k in range(len(many))]

    def derivatives(self, many: Sequence[Stretch], values: np.ndarray) -> Prediction:
        """Caps, and their exact derivatives by the free offsets of the starts, at values (n,)."""
        offsets = np.zeros((len(many), 12 * self.structure.n_rods + self.structure.n_actuated))
        return self.predict([one.window for one in many], values, offsets, jacobian=True)

    def _directions(
        self, x: Tensor, s0: Tensor, moved: Tensor | None, by_delay: np.ndarray
    ) -> tuple[Tensor, Tensor | None, Tensor | None]:
        import torch

        assert moved is not None  # noqa: S101 - `derivatives` hands them in
        del by_delay
        none = torch.zeros(len(self.model.packed(x)), len(self.moved), dtype=x.dtype)
        return none, None, displacement_jacobian(self.structure, s0, moved)[..., self.moved]

    def _seen(
        self, windows: Sequence[object], x: Tensor, flat: Tensor, tangents: Tensor | None, with_offsets: bool
    ) -> Prediction:
        import torch
        from torch.func import jacfwd, vmap

        from r2s2r_cli.engine import end_caps
        from r2s2r_cli.engine.flat import unpack_parameters, unpack_state
        from r2s2r_cli.engine.hooks import effective
        from r2s2r_cli.stages.identify.predict import STRIDE

        if tangents is None:
            return super()._seen(windows, x, flat, tangents, with_offsets)  # type: ignore[arg-type]
        at = [(w.run.t[w.frames] - w.start) / (self.step * STRIDE) for w in windows]  # type: ignore[attr-defined]
        index = torch.as_tensor(np.concatenate([np.full(len(a), k) for k, a in enumerate(at)]))
        place = torch.as_tensor(np.concatenate(at))
        low = place.floor().long()
        share = (place - low)[:, None]
        states = flat[index, low] * (1 - share) + flat[index, low + 1] * share
        p = self.model.packed(x)
        theta = effective(self.structure, unpack_parameters(self.structure, p[None]))

        def caps(s: Tensor) -> Tensor:
            return end_caps(theta, unpack_state(self.structure, s[None]))[0]

        along = tangents[index, low] * (1 - share[..., None]) + tangents[index, low + 1] * share[..., None]
        d = torch.einsum("fcis,fsd->fcid", vmap(jacfwd(caps))(states), along).numpy()
        p_WE = vmap(caps)(states).numpy() + np.array([0.0, 0.0, self.model.observation().ground_height])
        return Prediction(p_WE, index.numpy(), None, d)

    def _batch(self, many: Sequence[Stretch], values: np.ndarray) -> list[Seen]:
        """K hypotheses of some stretches of about the same length."""
        import torch

        from r2s2r_cli.engine import delay_of
        from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state

        structure, step, k = self.structure, self.step, len(values)
        own = self.model.theta(values)
        theta = own.map(lambda x: x.expand(k, *x.shape[1:]).repeat_interleave(len(many), dim=0))
        s0 = torch.cat([pack_state(structure, one.window.state) for one in many]).repeat(k, 1)
        rows = EVERY * (math.ceil(max(one.window.duration for one in many) / step / EVERY - TINY) + 1)
        late = self.model.observation()
        own_delay = delay_of(structure, own)
        delays = np.zeros(k) if own_delay is None else own_delay.expand(k, 1)[:, 0].numpy()
        u = self._commands_at(many, rows, delays + late.command_delay + late.camera_delay)
        self.rollouts += len(s0)
        n = self.simulator.substeps(theta, unpack_state(structure, s0), step)
        with torch.no_grad():
            flat = self.simulator.advance(
                s0, u, pack_parameters(structure, theta), h=step / n, hold=n, every=EVERY * n
            )  # fmt: skip
            return [self._one(own, k, flat[i :: len(many)], one, late.ground_height) for i, one in enumerate(many)]

    def _commands_at(self, many: Sequence[Stretch], rows: int, delays: np.ndarray) -> Tensor:
        """Commands (k stretch, row, actuated), each hypothesis with its own delay [s]."""
        import torch

        logs = [CommandLog(one.window.run) for one in many]
        made = {
            (i, delay): log.means(one.window.start, rows, step=self.step, delay=delay)
            for i, (log, one) in enumerate(zip(logs, many, strict=True))
            for delay in set(delays.tolist())
        }
        return torch.as_tensor(np.stack([made[i, delay] for delay in delays.tolist() for i in range(len(many))]))

    def _one(self, own: Parameters, k: int, flat: Tensor, one: Stretch, up: float) -> Seen:
        """What is seen of one stretch, from its states (k, stored, NS)."""
        import torch

        from r2s2r_cli.engine import end_caps, observe, sense
        from r2s2r_cli.engine.flat import unpack_state
        from r2s2r_cli.engine.hooks import effective, overrides

        stored = flat.shape[1]
        every = EVERY * self.step
        one_robot = own.map(lambda x: x[:1])  # no effect moves the caps on a rod
        caps = end_caps(effective(self.structure, one_robot), unpack_state(self.structure, flat.flatten(0, 1)))
        caps = caps.unflatten(0, (k, stored))
        ends = torch.as_tensor(self.cable_caps)
        length = torch.linalg.vector_norm(caps[:, :, ends[:, 0]] - caps[:, :, ends[:, 1]], dim=-1)
        t = torch.as_tensor(one.window.start + every * np.arange(stored))
        camera = observe(
            self.structure, own.map(lambda x: x.expand(k, *x.shape[1:])), t,
            caps + torch.tensor([0.0, 0.0, up], dtype=caps.dtype),
        )  # fmt: skip
        sensing = {effect.name for effect in overrides(self.structure, "sensing")}
        read = one_robot.with_values({
            name: x.expand(k, *x.shape[1:]).repeat_interleave(stored, dim=0)
            for name, x in own.extra.items() if name.split(".")[0] in sensing
        })  # fmt: skip
        length = sense(self.structure, read, length.flatten(0, 1), t.repeat(k)[:, None]).unflatten(0, (k, stored))
        at = torch.as_tensor((one.t - one.window.start) / every)
        low = (at + TINY).floor().long()
        share = at - low
        at_caps = camera[:, low] * (1 - share)[None, :, None, None] + camera[:, low + 1] * share[None, :, None, None]
        at_length = length[:, low] * (1 - share)[None, :, None] + length[:, low + 1] * share[None, :, None]
        return Seen(at_caps.numpy(), at_length.numpy()[..., list(one.sensors)])
