"""Many hypotheses through the engine at once: what camera and length sensors would have seen of every stretch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.begins import TINY, between, carried, placed
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.offsets import displaced
from r2s2r_cli.stages.identify.predict import Predictor, alike

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State

EVERY = 10
"""Engine steps between stored states."""
MOST = 256
"""Simulations in one batch."""


@dataclass(frozen=True)
class Seen:
    """Of one stretch, for k hypotheses: caps (k, F, cap, 3) [m], as the camera sees them, and length (k, F, sensor)
    [m], as the sensors read them. What left the finite numbers is nan."""

    caps: np.ndarray
    length: np.ndarray


class Replayer(Predictor):
    """Simulates stretches by command replay, many hypotheses at once."""

    def __init__(self, model: Model, **how: object) -> None:
        super().__init__(model, **how)  # type: ignore[arg-type]
        self.model = model

    def seen(self, many: Sequence[Stretch], values: np.ndarray) -> list[Seen]:
        """Of every stretch at values (k, n). A piece that comes after another one of `many` goes on with what that left
        of slack cables and the memory of effects, each hypothesis with its own."""
        parts: dict[int, Seen] = {}
        after: dict[tuple[str, int, int], Tensor] = {}
        for depth in sorted({one.piece for one in many}):
            rows = [k for k, one in enumerate(many) if one.piece == depth]
            for group in alike([many[k].window for k in rows]):
                own = [rows[i] for i in group]
                begin = [after.get((many[k].run, many[k].interval, depth - 1)) for k in own]
                found = self._chunked([many[k] for k in own], values, begin)
                for k, (one, last) in zip(own, found, strict=True):
                    parts[k] = one
                    after[many[k].run, many[k].interval, depth] = last
        return [parts[k] for k in range(len(many))]

    def finals(self, many: Sequence[Stretch], values: np.ndarray) -> State:
        """States at the last frame of stretches, a batch, at values (n,)."""
        from r2s2r_cli.engine.flat import unpack_state

        found: dict[int, Tensor] = {}
        for group in alike([one.window for one in many]):
            for k, (_, last) in zip(group, self._batch([many[k] for k in group], values[None]), strict=True):
                found[k] = last
        return unpack_state(self.structure, _cat([found[k] for k in range(len(many))]))

    def around(self, many: Sequence[Stretch], values: np.ndarray, sd: Sequence[np.ndarray]) -> list[Seen]:
        """Of every stretch, at values (n,), from its own start and with each offset of the start (`offsets.displaced`)
        moved by its sd (offset,): (1 + offset, ...). Finite steps, because where caps slip and stick a derivative at a
        point may be a thousand times what a millimetre does."""
        import torch

        from r2s2r_cli.engine.flat import pack_state

        parts: dict[int, Seen] = {}
        for group in alike([one.window for one in many]):
            own = [many[k] for k in group]
            starts = [
                displaced(
                    self.structure, pack_state(self.structure, many[k].window.state).expand(1 + len(sd[k]), -1),
                    torch.nn.functional.pad(torch.diag(torch.as_tensor(sd[k])), (0, 0, 1, 0)),
                )
                for k in group
            ]  # fmt: skip
            alone = np.repeat(values[None], len(starts[0]), axis=0)
            for k, (one, _) in zip(group, self._chunked(own, alone, starts=starts), strict=True):
                parts[k] = one
        return [parts[k] for k in range(len(many))]

    def _chunked(
        self, many: Sequence[Stretch], values: np.ndarray, begin: Sequence[Tensor | None] = (), *,
        starts: Sequence[Tensor] = (),
    ) -> list[tuple[Seen, Tensor]]:  # fmt: skip
        """`_batch`, at most MOST simulations at a time."""
        together = max(1, MOST // len(many))
        chunks = []
        for first in range(0, len(values), together):
            rows = slice(first, first + together)
            chunks.append(
                self._batch(
                    many, values[rows], [None if one is None else one[rows] for one in begin],
                    starts=[one[rows] for one in starts],
                )
            )  # fmt: skip
        return [
            (
                Seen(
                    np.concatenate([seen.caps for seen, _ in parts]), np.concatenate([seen.length for seen, _ in parts])
                ),
                _cat([last for _, last in parts]),
            )
            for parts in zip(*chunks, strict=True)
        ]

    def _batch(
        self, many: Sequence[Stretch], values: np.ndarray, begin: Sequence[Tensor | None] = (), *,
        starts: Sequence[Tensor] = (),
    ) -> list[tuple[Seen, Tensor]]:  # fmt: skip
        """K hypotheses of some stretches of about the same length: what is seen, and states (k, NS) at the last frame.
        begin: states (k, NS) that the piece before each ended in, None: its own start is all there is. starts: those of
        each hypothesis (k, NS), by stretch, instead."""
        import torch

        from r2s2r_cli.engine import delay_of
        from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state

        structure, step, k = self.structure, self.step, len(values)
        own, behind = self._undelayed(self.model.theta(values), k)
        theta = own.map(lambda x: x.expand(k, *x.shape[1:]).repeat_interleave(len(many), dim=0))
        starts = list(starts) or [pack_state(structure, one.window.state).expand(k, -1) for one in many]
        for i, before in enumerate(begin):
            if before is not None:
                starts[i] = carried(structure, many[i], starts[i], before)
        late = self.model.observation()
        starts = [placed(structure, own, one, late.ground_height) for one in starts]
        s0 = torch.stack(starts, dim=1).flatten(0, 1)
        lasting = max(one.window.duration for one in many) + max(0.0, float(behind.max()))
        rows = EVERY * (math.ceil(lasting / step / EVERY - TINY) + 1)
        own_delay = delay_of(structure, own)
        delays = np.zeros(k) if own_delay is None else own_delay.expand(k, 1)[:, 0].numpy()
        u = self._commands_at(many, rows, delays + behind + late.command_delay + late.camera_delay)
        self.rollouts += len(s0)
        n = self.simulator.substeps(theta, unpack_state(structure, s0), step)
        with torch.no_grad():
            flat = self.simulator.advance(
                s0, u, pack_parameters(structure, theta), h=step / n, hold=n, every=EVERY * n
            )  # fmt: skip
            seen = self._looked(own, behind, flat, many, late.ground_height)
        ends = [torch.full((k, 1), one.window.duration / (EVERY * step), dtype=torch.float64) for one in many]
        return [(one, between(flat[i :: len(many)], ends[i])[:, 0]) for i, one in enumerate(seen)]

    def _undelayed(self, own: Parameters, k: int) -> tuple[Parameters, np.ndarray]:
        """The parameters without the camera's delay, and that delay (k,) [s]. A stretch starts where the camera saw the
        robot: by the camera's clock commands come later, and the sensors read what it will see."""
        import torch

        name = "camera_delay.tau_s"
        if name not in own.extra:
            return own, np.zeros(k)
        behind = own.extra[name].expand(k, 1)[:, 0].numpy().copy()
        return own.with_values({name: torch.zeros_like(own.extra[name])}), behind

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

    def _looked(
        self, own: Parameters, behind: np.ndarray, flat: Tensor, many: Sequence[Stretch], up: float
    ) -> list[Seen]:
        """What is seen of each stretch, from the states (k stretch, stored, NS). behind (k,) [s]: of the camera."""
        import torch

        from r2s2r_cli.engine import end_caps, observe, sense
        from r2s2r_cli.engine.flat import unpack_state
        from r2s2r_cli.engine.hooks import effective, overrides

        k, stored, every = len(behind), flat.shape[1], EVERY * self.step
        one_robot = own.map(lambda x: x[:1])  # no effect moves the caps on a rod
        caps = end_caps(effective(self.structure, one_robot), unpack_state(self.structure, flat.flatten(0, 1)))
        caps = caps.unflatten(0, (k, len(many), stored))
        ends = torch.as_tensor(self.cable_caps)
        length = torch.linalg.vector_norm(caps[..., ends[:, 0], :] - caps[..., ends[:, 1], :], dim=-1)
        begin = torch.as_tensor([one.window.start for one in many])
        t = begin[:, None] + every * torch.arange(stored)
        sensing = {effect.name for effect in overrides(self.structure, "sensing")}
        read = one_robot.with_values({
            name: x.expand(k, *x.shape[1:]).repeat_interleave(len(many) * stored, dim=0)
            for name, x in own.extra.items() if name.split(".")[0] in sensing
        })  # fmt: skip
        length = sense(self.structure, read, length.flatten(0, 2), t.repeat(k, 1, 1).reshape(-1, 1))
        length = length.unflatten(0, (k, len(many), stored))
        wide = own.map(lambda x: x.expand(k, *x.shape[1:]))
        lift = torch.tensor([0.0, 0.0, up], dtype=caps.dtype)
        found = []
        for i, one in enumerate(many):
            since = torch.as_tensor(one.t - one.window.start)
            shown = between(caps[:, i], (since / every).expand(k, -1))
            camera = observe(self.structure, wide, torch.as_tensor(one.t), shown + lift)
            lengths = between(length[:, i], (since + torch.as_tensor(behind)[:, None]) / every)
            found.append(Seen(camera.numpy(), lengths.numpy()[..., list(one.sensors)]))
        return found


def _cat(parts: Sequence[Tensor]) -> Tensor:
    import torch

    return torch.cat(list(parts))
