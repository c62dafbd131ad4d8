"""The link between a controller and its winches: a command acts later than the tick that made it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError


@dataclass(frozen=True)
class Link:
    """How commands get to the winches, and what was on its way before the controller took over.

    delay: from a tick to the winch [s], a number or (B, 1), differentiable where a command changes. sent: commands of
    the K ticks before the controller's first, newest last, (B or 1, K, actuated); before them 0. lead: how many of
    these ticks lie inside the simulation, a number or (B,) int64: the controller makes its first tick at tick `lead`.
    Raises EngineInputError for times that cannot be.
    """

    delay: Tensor | float = 0.0
    sent: Tensor | None = None
    lead: Tensor | int = 0

    def __post_init__(self) -> None:
        delay, lead = torch.as_tensor(self.delay), torch.as_tensor(self.lead)
        if bool((delay < 0).any()) or not bool(torch.isfinite(delay).all()):
            raise EngineInputError("link.delay", "no time to wait", expected="0 s or more, finite", received=str(delay))
        known = 0 if self.sent is None else self.sent.shape[1]
        if bool(((lead < 0) | (lead > known)).any()):
            raise EngineInputError("link.lead", "commands that are not known", expected=f"0 to {known} ticks",
                                   received=str(self.lead))  # fmt: skip

    def tensors(self, like: Tensor) -> dict[str, Tensor]:
        """Its numbers, batch first, in the dtype and on the device of `like`."""
        found = {"link.delay": torch.as_tensor(self.delay).reshape(-1), "link.lead": torch.as_tensor(self.lead)}
        found = {**found, **({} if self.sent is None else {"link.sent": self.sent})}
        return {name: one.reshape(-1, *one.shape[1:]).to(like) for name, one in found.items()}

    def line(self, batch: int, like: Tensor, period: float, rows: int) -> DelayLine:
        """The commands under way at the start of a simulation of `rows` engine steps a tick of `period` [s].

        like: a command (B or 1, actuated) of the dtype and device wanted.
        """
        delay = torch.as_tensor(self.delay, dtype=like.dtype, device=like.device).reshape(-1, 1).expand(batch, 1)
        whole = torch.floor(delay.detach() / period + 1e-9).to(torch.long)[:, 0]
        late = torch.clamp(delay / period - whole[:, None], min=0.0) * rows
        fresh = torch.clamp(torch.arange(1, rows + 1, dtype=like.dtype, device=like.device) - late, 0.0, 1.0)
        lead = torch.as_tensor(self.lead, device=like.device).reshape(-1).expand(batch)
        depth = int(whole.max()) + 2
        sent = like.new_zeros(batch, 0, like.shape[-1])
        if self.sent is not None:
            sent = self.sent.to(like).expand(batch, -1, -1)
        padded = torch.cat([sent.new_zeros(batch, depth, like.shape[-1]), sent], dim=1)
        # Row r of an environment is the tick `first + r`; the line begins with the `depth` ticks before the start.
        at = padded.shape[1] - lead[:, None] - depth + torch.arange(depth, device=like.device)
        line = padded[torch.arange(batch, device=like.device)[:, None], at]
        return DelayLine(line, padded, whole, fresh, lead)


@dataclass(frozen=True)
class DelayLine:
    """Commands under way. recent: of the last ticks, newest last, (B, depth, actuated); sent: given ones, newest last;
    whole: ticks of delay, (B,); fresh: share of the newer of two commands in each engine step of a tick, (B, row);
    lead: (B,)."""

    recent: Tensor
    sent: Tensor
    whole: Tensor
    fresh: Tensor
    lead: Tensor

    def given(self, tick: int) -> Tensor:
        """The command that was sent at a tick before the controller took over, (B, actuated); after that any."""
        at = (self.sent.shape[1] - self.lead + tick).clamp(max=self.sent.shape[1] - 1)
        return self.sent[torch.arange(len(at), device=at.device), at]

    def pushed(self, u: Tensor) -> tuple[Tensor, DelayLine]:
        """What the winches get in the engine steps of a tick, (B, row, actuated), and the line with its command u."""
        recent = torch.cat([self.recent[:, 1:], u[:, None]], dim=1)
        batch, newest = torch.arange(len(u), device=u.device), recent.shape[1] - 1 - self.whole
        new, old = recent[batch, newest][:, None], recent[batch, newest - 1][:, None]
        rows = self.fresh[..., None] * new + (1 - self.fresh[..., None]) * old
        return rows, DelayLine(recent, self.sent, self.whole, self.fresh, self.lead)
