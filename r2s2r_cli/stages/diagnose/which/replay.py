"""Many hypotheses through the engine at once: what camera and length sensors would have seen of every stretch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.begins import TINY, between, carried, placed
from r2s2r_cli.stages.diagnose.which.looks import Seen, looked
from r2s2r_cli.stages.diagnose.which.motion import first_of_each
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.offsets import displaced
from r2s2r_cli.stages.identify.predict import Predictor, alike

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State

EVERY = 10
"""Engine steps between stored states."""
MOST = 256
"""Simulations in one batch."""


class Replayer(Predictor):
    """Simulates stretches by command replay, many hypotheses at once."""

    def __init__(self, model: Model, **how: object) -> None:
        super().__init__(model, **how)  # type: ignore[arg-type]
        self.model = model
        self._logs: dict[int, tuple[RunData, CommandLog]] = {}

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
        s0 = placed(structure, theta, torch.stack(starts, dim=1).flatten(0, 1), late.ground_height)
        lasting = max(one.window.duration for one in many) + max(0.0, float(behind.max()))
        rows = EVERY * (math.ceil(lasting / step / EVERY - TINY) + 1)
        own_delay = delay_of(structure, own)
        delays = np.zeros(k) if own_delay is None else own_delay.expand(k, 1)[:, 0].numpy()
        delays = delays + behind + late.command_delay + late.camera_delay
        first, back = first_of_each(structure, own, s0, delays)
        moved, all_of = _rows(first, len(many)), _rows(back, len(many))
        u = self._commands_at(many, rows, delays[first])
        self.rollouts += len(moved)
        packed = pack_parameters(structure, theta).expand(len(s0), -1)[moved]
        n = self.simulator.substeps(theta, unpack_state(structure, s0), step)
        with torch.no_grad():
            flat = self.simulator.advance(s0[moved], u, packed, h=step / n, hold=n, every=EVERY * n)
            seen = looked(
                structure, theta, flat, all_of, many, behind, every=EVERY * step, cable_caps=self.cable_caps,
                up=late.ground_height,
            )  # fmt: skip
        lasted = torch.as_tensor([one.window.duration / (EVERY * step) for one in many], dtype=torch.float64)
        last = between(flat, lasted.repeat(len(first))[:, None])[all_of, 0]
        return [(one, last[i :: len(many)]) for i, one in enumerate(seen)]

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

        own, back = np.unique(delays, return_inverse=True)
        made = np.stack([self._log(one.window.run).all_means(one.window.start, rows, step=self.step, delays=own)
                         for one in many], axis=1)  # fmt: skip
        return torch.as_tensor(made[back].reshape(-1, *made.shape[2:]))

    def _log(self, run: RunData) -> CommandLog:
        """Of a run, made once."""
        if id(run) not in self._logs:
            self._logs[id(run)] = (run, CommandLog(run))  # the run is kept: no other one gets its id
        return self._logs[id(run)][1]


def _rows(hypotheses: np.ndarray, stretches: int) -> Tensor:
    """Rows of hypotheses in a batch (k stretch, ...)."""
    import torch

    return torch.as_tensor((hypotheses[:, None] * stretches + np.arange(stretches)).ravel())


def _cat(parts: Sequence[Tensor]) -> Tensor:
    import torch

    return torch.cat(list(parts))
