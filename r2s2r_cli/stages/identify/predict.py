"""Windows through the engine: end caps at the observed frames, and their exact derivatives by parameters and starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError, UsageError
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.offsets import count, displaced, displacement_jacobian
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.stages.identify.free import Mapping

STRIDE = 5
"""Engine steps between two stored states. Between them caps are interpolated: at 1 ms an acceleration of 10 m/s^2 bends
the path by 0.03 mm."""


@dataclass(frozen=True)
class Prediction:
    """p_WE: end caps at the compared frames of all windows, one after the other, as the camera sees them [m],
    (F, cap, 3); window: which window each frame is of, (F,). by_value (F, cap, 3, n) [m per unit], by_offset
    (F, cap, 3, offset): derivatives by parameters and by the offsets of the frame's own window; None if not asked."""

    p_WE: np.ndarray
    window: np.ndarray
    by_value: np.ndarray | None = None
    by_offset: np.ndarray | None = None


class Predictor:
    """Simulates windows by command replay. Holds the compiled step: keep it for a whole fit.

    step: of the engine [s]. cache_dir: of the machine code. rollouts counts simulated windows. Raises UsageError for a
    free number that a start state would have to follow.
    """

    def __init__(
        self, mapping: Mapping, *, step: float = 1e-3, cache_dir: Path | None = None, threads: int = 2
    ) -> None:
        from r2s2r_cli.engine.rollout import Simulator

        moving = [name for name in mapping.names if name.startswith("com.")]
        if moving:
            # Start states are places of the centres of mass: these would have to move along.
            raise UsageError(
                f"{moving[0]} cannot be free in command replay", where="--free", expected="it given, not fitted",
                received=", ".join(moving), hint=f"r2s2r identify --fix {moving[0]}=0.005",
            )  # fmt: skip
        self.mapping = mapping
        self.structure = mapping.structure
        self.cable_caps = tuple((a, b) for a, b in (cable.caps for cable in mapping.robot.cables))
        self.step = step
        self.simulator = Simulator(self.structure, cache_dir=cache_dir, threads=threads)
        self.rollouts = 0

    @property
    def native(self) -> bool:
        """Whether machine code does the steps."""
        import torch

        return bool(self.simulator.kernels.native(torch.zeros(1, dtype=torch.float64)))

    def predict(
        self,
        windows: Sequence[Window],
        values: np.ndarray,
        offsets: np.ndarray | None = None,
        *,
        jacobian: bool = False,
    ) -> Prediction:
        """End caps of windows at parameter values (n,), start states moved by offsets (W, offset); None: not moved, and
        no derivatives by them. Raises NumericalError where the simulation leaves the finite numbers, InputError for
        values that are no robot.
        """
        groups = alike(windows)
        parts = []
        for group in groups:
            own = None if offsets is None else offsets[group]
            parts.append(self._together([windows[k] for k in group], values, own, jacobian))
        return joined(groups, parts, len(windows))

    def _together(
        self, windows: Sequence[Window], values: np.ndarray, offsets: np.ndarray | None, jacobian: bool
    ) -> Prediction:
        """Windows of about the same length as one batch."""
        import torch

        from r2s2r_cli.engine import EngineError
        from r2s2r_cli.engine.flat import pack_state, unpack_state

        x = torch.as_tensor(values, dtype=torch.float64)
        theta = self.mapping.theta(x)
        seen = self.mapping.observation(values)
        s0 = torch.cat([pack_state(self.structure, window.state) for window in windows])
        moved = None if offsets is None else torch.as_tensor(offsets, dtype=torch.float64)
        rows = STRIDE * (math.ceil(max(window.duration for window in windows) / self.step / STRIDE) + 1)
        u, by_delay = self._commands(windows, rows, seen.command_delay + seen.camera_delay)
        self.rollouts += len(windows)
        try:
            if not jacobian:
                start = s0 if moved is None else displaced(self.structure, s0, moved)
                with torch.no_grad():
                    run = self.simulator.rollout(
                        theta, unpack_state(self.structure, start), u, step=self.step, every=STRIDE
                    )
                tangents = None
            else:
                d_p, d_u, d_s = self._directions(x, s0, moved, by_delay)
                start = s0 if moved is None else displaced(self.structure, s0, moved)
                run, tangents = self.simulator.jvp(
                    theta, unpack_state(self.structure, start), u, d_parameters=d_p, d_state=d_s, d_commands=d_u,
                    step=self.step, every=STRIDE,
                )  # fmt: skip
        except EngineError as error:
            raise refused(error, windows) from error
        return self._seen(windows, x, pack_state(self.structure, run.states, leading=2), tangents, moved is not None)

    def _commands(self, windows: Sequence[Window], rows: int, delay: float) -> tuple[Tensor, np.ndarray]:
        """Commands (W, row, actuated) and their derivatives by the delay."""
        import torch

        logs = {id(window.run): CommandLog(window.run) for window in windows}
        both = [logs[id(w.run)].rows(w.start, rows, step=self.step, delay=delay) for w in windows]
        return torch.as_tensor(np.stack([u for u, _ in both])), np.stack([d for _, d in both])

    def _directions(
        self, x: Tensor, s0: Tensor, moved: Tensor | None, by_delay: np.ndarray
    ) -> tuple[Tensor, Tensor | None, Tensor | None]:
        """Tangents of parameters (NP, D), commands (W, row, actuated, D) and start states (W, NS, D): D are the
        parameters, then the offsets, which are those of each window's own start."""
        import torch

        n, extra = len(x), 0 if moved is None else count(self.structure)
        d_p = torch.nn.functional.pad(self.mapping.jacobian(x), (0, extra))
        delays = self.mapping.delays
        d_u = None
        if delays:
            d_u = torch.zeros(*by_delay.shape, n + extra, dtype=torch.float64)
            for k in delays:
                d_u[..., k] = torch.as_tensor(by_delay)
        d_s = None
        if moved is not None:
            d_s = torch.nn.functional.pad(displacement_jacobian(self.structure, s0, moved), (n, 0))
        return d_p, d_u, d_s

    def _seen(
        self, windows: Sequence[Window], x: Tensor, flat: Tensor, tangents: Tensor | None, with_offsets: bool
    ) -> Prediction:
        """End caps at the frames from the stored states flat (W, stored, NS) and their tangents (W, stored, NS, D)."""
        import torch
        from torch.func import jacfwd, vmap

        from r2s2r_cli.engine import end_caps, observe
        from r2s2r_cli.engine.flat import unpack_parameters, unpack_state
        from r2s2r_cli.engine.hooks import effective

        at = [(w.run.t[w.frames] - w.start) / (self.step * STRIDE) for w in windows]
        index = torch.as_tensor(np.concatenate([np.full(len(a), k) for k, a in enumerate(at)]))
        place = torch.as_tensor(np.concatenate(at))
        low = place.floor().long()
        share = (place - low)[:, None]
        states = flat[index, low] * (1 - share) + flat[index, low + 1] * share

        def caps(s: Tensor, p: Tensor) -> Tensor:
            theta = effective(self.structure, unpack_parameters(self.structure, p[None]))
            seen = end_caps(theta, unpack_state(self.structure, s[None]))
            return observe(self.structure, theta, now, seen[:, None])[0, 0]

        now = torch.zeros(1, dtype=torch.float64)  # what depends on time is no number of the engine (Mapping.delays)
        p = torch.as_tensor(self.mapping.packed(x))
        p_WE = vmap(lambda s: caps(s, p))(states).numpy()
        values = x.numpy()
        p_WE = p_WE + np.array([0.0, 0.0, self.mapping.observation(values).ground_height])
        if tangents is None:
            return Prediction(p_WE, index.numpy())
        along = tangents[index, low] * (1 - share[..., None]) + tangents[index, low + 1] * share[..., None]
        d = torch.einsum("fcis,fsd->fcid", vmap(lambda s: jacfwd(caps, argnums=0)(s, p))(states), along)
        n = len(x)
        by_p = vmap(lambda s: jacfwd(caps, argnums=1)(s, p))(states)
        by_value = (d[..., :n] + torch.einsum("fcip,pd->fcid", by_p, self.mapping.jacobian(x))).numpy()
        for k, name in enumerate(self.mapping.names):
            if name == "ground_height":
                by_value[:, :, 2, k] += 1.0
        return Prediction(p_WE, index.numpy(), by_value, d[..., n:].numpy() if with_offsets else None)


LONGER = 1.3
"""Windows are simulated together while the longest lasts at most so many times the shortest: all run as long."""


def alike(windows: Sequence[Window]) -> list[list[int]]:
    """Numbers of the windows in groups of about the same length."""
    groups: list[list[int]] = []
    for k in sorted(range(len(windows)), key=lambda k: windows[k].duration):
        if groups and windows[k].duration <= LONGER * windows[groups[-1][0]].duration:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def joined(groups: Sequence[Sequence[int]], parts: Sequence[Prediction], count: int) -> Prediction:
    """The predictions of groups of windows as one, in the order of the windows."""
    place = {k: (part, i) for part, group in enumerate(groups) for i, k in enumerate(group)}
    rows = [(parts[part], parts[part].window == i) for part, i in (place[k] for k in range(count))]

    def one(name: str) -> np.ndarray | None:
        if getattr(parts[0], name) is None:
            return None
        return np.concatenate([getattr(part, name)[mask] for part, mask in rows])

    p_WE = one("p_WE")
    assert p_WE is not None  # noqa: S101 - every prediction has it
    window = np.concatenate([np.full(int(mask.sum()), k) for k, (_, mask) in enumerate(rows)])
    return Prediction(p_WE, window, one("by_value"), one("by_offset"))


def refused(error: Exception, windows: Sequence[Window]) -> Exception:
    """The engine's error in our words; NumericalError where a fit may try a smaller step."""
    from r2s2r_cli.engine import EngineInputError, NonFiniteError

    runs = ", ".join(sorted({window.run.name for window in windows}))
    if isinstance(error, NonFiniteError):
        return NumericalError(
            "the simulation left the finite numbers", where=f"{runs}, {error.time:g} s after a start, {error.body}",
            expected="finite numbers", received=error.term, hint="r2s2r identify --show-config",
        )  # fmt: skip
    if isinstance(error, EngineInputError):
        return NumericalError(
            f"the fit tried a robot that cannot be: {error.what}", where=error.field, expected=error.expected,
            received=error.received, hint="narrow its bounds: --free NAME=START,LOWER..UPPER",
        )  # fmt: skip
    return error
