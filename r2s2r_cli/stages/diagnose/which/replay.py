"""Many hypotheses through the engine at once: what camera and length sensors would have seen of every stretch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.begins import TINY, between, carried, placed, rows_of
from r2s2r_cli.stages.diagnose.which.looks import Seen, joined, looked
from r2s2r_cli.stages.diagnose.which.motion import first_of_each
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.orders import Orders
from r2s2r_cli.stages.diagnose.which.recent import Recent, digests
from r2s2r_cli.stages.diagnose.which.stable import Stable
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.turning import STEP_S, turning
from r2s2r_cli.stages.identify.offsets import displaced
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.prediction import alike
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State

EVERY = 10
"""Engine steps between stored states."""
MOST = 256
"""Simulations in one batch."""
FEW = 4
"""Hypotheses whose stretches are all simulated in one batch."""


class Replayer(Predictor):
    """Simulates stretches by command replay, many hypotheses at once."""

    def __init__(self, model: Model, **how: object) -> None:
        from r2s2r_cli.engine.hooks import effective

        super().__init__(model, **how)  # type: ignore[arg-type]
        self.model = model
        self._orders = Orders(self.structure.n_actuated)
        self._packed: dict[int, tuple[Stretch, Tensor]] = {}
        nominal = model.theta(model.values0)
        self._stable = Stable(self.structure, nominal)
        self._recent = Recent()
        self._p_BE = effective(self.structure, nominal).p_BE

    def seen(
        self, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray] | None = None
    ) -> list[Seen]:  # fmt: skip
        """Of every stretch at values (k, n). A piece that comes after another one of `many` goes on with what that left
        of slack cables and the memory of effects, each hypothesis with its own. by: of every stretch what each
        hypothesis begins away from its start, (k, offset) (`offsets.displaced`)."""
        import torch

        parts: dict[int, Seen] = {}
        after: dict[tuple[str, int, int], Tensor] = {}
        for depth in sorted({one.piece for one in many}):
            rows = [k for k, one in enumerate(many) if one.piece == depth]
            begin = {k: after.get((many[k].run, many[k].interval, depth - 1)) for k in rows}
            for k, one in self._grouped(many, rows, values, begin, by).items():
                parts[k] = one
                after[many[k].run, many[k].interval, depth] = torch.as_tensor(one.end)
        return [parts[k] for k in range(len(many))]

    def finals(self, many: Sequence[Stretch], values: np.ndarray) -> State:
        """States at the last frame of stretches, a batch, at values (n,)."""
        import torch

        from r2s2r_cli.engine.flat import unpack_state

        found: dict[int, np.ndarray] = {}
        for group in alike([one.window for one in many]):
            for k, one in zip(group, self._batch([many[k] for k in group], values[None]), strict=True):
                found[k] = one.end
        return unpack_state(self.structure, torch.as_tensor(np.concatenate([found[k] for k in range(len(many))])))

    def around(self, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray]) -> list[Seen]:
        """As `seen`, but every stretch stands alone, with nothing handed on to it. Finite steps, because where caps
        slip and stick a derivative at a point may be a thousand times what a millimetre does."""
        parts = self._grouped(many, range(len(many)), values, {}, by)
        return [parts[k] for k in range(len(many))]

    def _grouped(
        self, many: Sequence[Stretch], rows: Sequence[int], values: np.ndarray, begin: Mapping[int, Tensor | None],
        by: Sequence[np.ndarray] | None,
    ) -> dict[int, Seen]:  # fmt: skip
        """The stretches at places `rows`, in batches of about the same length, of at most MOST simulations. begin: by
        place, as `_batch`; by: of all of `many`."""
        chunks: dict[int, list[Seen]] = {k: [] for k in rows}
        for group in _groups([many[k].window for k in rows], len(values)):
            together, places = max(1, MOST // len(group)), [rows[i] for i in group]
            before = [begin.get(k) for k in places]
            for first in range(0, len(values), together):
                some = slice(first, first + together)
                found = self._batch(
                    [many[k] for k in places], values[some], [None if b is None else b[some] for b in before],
                    by=None if by is None else [by[k][some] for k in places],
                )  # fmt: skip
                for k, seen in zip(places, found, strict=True):
                    chunks[k].append(seen)
        return {k: joined(own) for k, own in chunks.items()}

    def _batch(
        self, many: Sequence[Stretch], values: np.ndarray, begin: Sequence[Tensor | None] = (), *,
        by: Sequence[np.ndarray] | None = None,
    ) -> list[Seen]:  # fmt: skip
        """K hypotheses of some stretches of about the same length. begin: states (k, NS) that the piece before each
        ended in, None: its own start is all there is. by: as `seen`."""
        import torch

        from r2s2r_cli.engine import delay_of
        from r2s2r_cli.engine.flat import pack_parameters

        structure, engine, step = self.structure, self.simulator, self.step
        k, count = len(values), len(many)
        own, behind = self._undelayed(self.model.theta(values), k)
        own = own.map(lambda x: x.expand(k, *x.shape[1:]))
        whose = torch.arange(k).repeat_interleave(count)
        late = self.model.observation()
        own_delay = delay_of(structure, own)
        delays = np.zeros(k) if own_delay is None else own_delay[:, 0].numpy()
        delays = delays + behind + late.command_delay + late.camera_delay
        turns = turning(
            structure, own, lambda rows: self._orders.means(many, rows, delays, step=STEP_S, before=rows * STEP_S)
        )
        s0 = placed(structure, own, whose, self._starts(many, k, begin, by, turns).flatten(0, 1), late.ground_height)
        lag = self.model.sensor_lags(values)
        lasting = max(one.window.duration + one.goes_on for one in many) + max(0.0, float((behind - lag).max()))
        rows = EVERY * (math.ceil(lasting / step / EVERY - TINY) + 1)
        packed = pack_parameters(structure, own)
        first, back = first_of_each(structure, packed, s0, delays)
        self.rollouts += len(first) * count
        n = self._substeps(many, own, whose, s0)
        starts = s0.numpy().reshape(k, count, -1)
        names = digests((n, [id(one) for one in many]), values, starts)
        # One environment alone runs in machine code of its own.
        new = ~(self._recent.known(names) & (count > 1))
        if new.any():
            motions, among = np.unique(back[new], return_inverse=True)
            which = first[motions]
            moved, all_of = _rows(which, count), _rows(among, count)
            u = torch.as_tensor(
                self._orders.means(many, rows, delays[which], step=step).reshape(-1, rows, structure.n_actuated)
            )
            theta = own if new.all() else rows_of(own, torch.as_tensor(new))
            with torch.no_grad():
                # Not `advance`: nothing is differentiated here, and that keeps a copy of all frames.
                flat = engine.kernels.forward(
                    s0[moved], u, packed[whose[moved]], h=step / n, hold=n, every=EVERY * n, threads=engine.threads
                )
                seen = looked(
                    structure, theta, flat, all_of, many, behind[new], lag[new],
                    every=EVERY * step, p_BE=self._p_BE, cable_caps=self.cable_caps, up=late.ground_height,
                )  # fmt: skip
            lasted = [(one.window.duration + one.goes_on) / (EVERY * step) for one in many]
            last = between(flat, torch.as_tensor(lasted, dtype=torch.float64).repeat(len(which))[:, None])
            ends = last[all_of, 0].numpy().reshape(-1, count, last.shape[-1])
            self._recent.keep(
                [name for name, yes in zip(names, new, strict=True) if yes],
                [Seen(*one, starts[new, i], ends[:, i]) for i, one in enumerate(seen)],
            )
        return self._recent.of(names)

    def _starts(
        self, many: Sequence[Stretch], k: int, begin: Sequence[Tensor | None], by: Sequence[np.ndarray] | None,
        turns: Tensor | None,
    ) -> Tensor:  # fmt: skip
        """Where k hypotheses begin stretches, (k, stretch, NS): begin, by as of `_batch`; turns: as `turning`."""
        import torch

        from r2s2r_cli.engine.flat import state_slots

        structure = self.structure
        start = torch.stack([self._flat(one) for one in many]).repeat(k, 1, 1)
        if turns is not None:
            winding = state_slots(structure)["winding"]
            start[..., winding.start : winding.start + winding.size] = turns
        let_out: Tensor | float = 0.0
        if by is not None:
            offsets = torch.as_tensor(np.stack(by, axis=1))
            start = displaced(structure, start.flatten(0, 1), offsets.flatten(0, 1)).unflatten(0, start.shape[:2])
            let_out = offsets[..., -structure.n_actuated :]
        after = [i for i, one in enumerate(begin) if one is not None]
        if after:
            before = torch.stack([one for one in begin if one is not None], dim=1)
            more = let_out if isinstance(let_out, float) else let_out[:, after]
            start[:, after] = carried(structure, [many[i] for i in after], start[:, after], before, more)
        return start

    def _flat(self, one: Stretch) -> Tensor:
        """The start state of a stretch, (NS,), packed once."""
        from r2s2r_cli.engine.flat import pack_state

        if id(one) not in self._packed:
            # The stretch is kept: no other one gets its id.
            self._packed[id(one)] = (one, pack_state(self.structure, one.window.state)[0])
        return self._packed[id(one)][1]

    def _substeps(self, many: Sequence[Stretch], own: Parameters, whose: Tensor, s0: Tensor) -> int:
        """Engine steps a step, as stiff cables need. own: batch k; whose (row,): of the starts s0 (row, NS)."""
        from r2s2r_cli.engine.flat import unpack_state
        from r2s2r_cli.engine.reading import stable_substeps

        places: set[object] = {(one.run, one.interval, one.piece) for one in many}
        for one in many:
            self._stable.learn((one.run, one.interval, one.piece), self._flat(one))
        if self.step <= self._stable.step(places, own):
            return 1
        return stable_substeps(self.structure, rows_of(own, whose), unpack_state(self.structure, s0), self.step)

    def _undelayed(self, own: Parameters, k: int) -> tuple[Parameters, np.ndarray]:
        """The parameters without the camera's delay, and that delay (k,) [s]. A stretch starts where the camera saw the
        robot: by the camera's clock commands come later, and the sensors read what it will see."""
        import torch

        name = "camera_delay.tau_s"
        if name not in own.extra:
            return own, np.zeros(k)
        behind = own.extra[name].expand(k, 1)[:, 0].numpy().copy()
        return own.with_values({name: torch.zeros_like(own.extra[name])}), behind


def _groups(windows: Sequence[Window], count: int) -> list[list[int]]:
    """Numbers of the windows in groups that are simulated together: of about the same length, but for so few
    hypotheses that a batch costs more than what it simulates beyond the end of some."""
    return [list(range(len(windows)))] if count <= FEW else alike(windows)


def _rows(hypotheses: np.ndarray, stretches: int) -> Tensor:
    """Rows of hypotheses in a batch (k stretch, ...)."""
    import torch

    return torch.as_tensor((hypotheses[:, None] * stretches + np.arange(stretches)).ravel())
