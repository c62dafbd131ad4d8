"""How near two rods are to each other: shafts as capsules, caps as spheres."""

from __future__ import annotations

import torch
from torch import Tensor

FASTEST = 3.0
"""[m/s] no two rods approach faster: what may touch within the step is looked at."""
_TINY = 1e-12


def candidates(a: Tensor, b: Tensor, radii: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Nine candidate contacts of rods with ends a, b (B, 2, 3): places along both rods 0..1, both radii, squared
    distances of the axes, each (B, 9): four caps against shafts, four caps against caps, shaft against shaft."""
    da, db, d = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0], b[:, 0] - a[:, 0]
    aa, ab, bb = (da * da).sum(-1), (da * db).sum(-1), (db * db).sum(-1)
    ad, bd, dd = (da * d).sum(-1), (db * d).sum(-1), (d * d).sum(-1)

    def on_a(t: Tensor) -> Tensor:
        return torch.clamp((ad + t * ab) / aa, 0.0, 1.0)

    def on_b(s: Tensor) -> Tensor:
        return torch.clamp((s * ab - bd) / bb, 0.0, 1.0)

    zero = torch.zeros_like(aa)
    one = torch.ones_like(aa)
    det = aa * bb - ab * ab
    crossing = det > 1e-9 * aa * bb  # parallel shafts touch at a cap first
    inner = torch.clamp((ad * bb - bd * ab) / torch.where(crossing, det, one), 0.0, 1.0)
    t_inner = on_b(inner)
    s = torch.stack([zero, one, on_a(zero), on_a(one), zero, zero, one, one, on_a(t_inner)], dim=1)
    t = torch.stack([on_b(zero), on_b(one), zero, one, zero, one, zero, one, t_inner], dim=1)
    ra, a0, a1, rb, b0, b1 = radii.unbind(1)
    r_a = torch.stack([a0, a1, ra, ra, a0, a0, a1, a1, ra], dim=1)
    r_b = torch.stack([rb, rb, b0, b1, b0, b1, b0, b1, rb], dim=1)
    aa, ab, bb, ad, bd, dd = (x[:, None] for x in (aa, ab, bb, ad, bd, dd))
    squared = dd + s * (s * aa - 2.0 * (ad + t * ab)) + t * (t * bb + 2.0 * bd)
    return s, t, r_a, r_b, squared


def nearest(s: Tensor, t: Tensor, r_a: Tensor, r_b: Tensor, squared: Tensor) -> tuple[Tensor, ...]:
    """The candidate with the smallest gap, each (B, 1)."""
    gaps = torch.sqrt(torch.clamp(squared, min=_TINY)) - r_a - r_b
    best = [x[:, :1] for x in (s, t, r_a, r_b)]
    least = gaps[:, :1]
    for k in range(1, gaps.shape[1]):
        closer = gaps[:, k : k + 1] < least
        best = [torch.where(closer, x[:, k : k + 1], old) for x, old in zip((s, t, r_a, r_b), best, strict=True)]
        least = torch.where(closer, gaps[:, k : k + 1], least)
    return tuple(best)


def near(a: Tensor, b: Tensor, squares: tuple[Tensor, Tensor], radii: Tensor, h: Tensor) -> Tensor:
    """Whether two rods may touch within the step, (B,): the nine candidates again, without a division or a root, and
    never less than they are. squares: of the rods' lengths, known beforehand [m^2]."""
    da, db, d = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0], b[:, 0] - a[:, 0]
    aa, bb = squares
    ab, ad, bd, dd = (da * db).sum(-1), (da * d).sum(-1), (db * d).sum(-1), (d * d).sum(-1)
    ra, a0, a1, rb, b0, b1 = radii.unbind(1)
    reach = FASTEST * h[:, 0]

    def within(squared: Tensor, radius: Tensor) -> Tensor:
        return squared < (radius + reach) * (radius + reach)

    found = within(dd, a0 + b0) | within(dd + bb + 2.0 * bd, a0 + b1) | within(dd + aa - 2.0 * ad, a1 + b0)
    found = found | within(dd + aa + bb - 2.0 * (ad + ab - bd), a1 + b1)
    per_a, per_b = 1.0 / aa, 1.0 / bb
    for start, radius in ((0.0, a0), (1.0, a1)):  # caps of a at both ends of its axis, against the shaft b
        t = torch.clamp((start * ab - bd) * per_b, 0.0, 1.0)
        found = found | within(dd + start * (aa - 2.0 * (ad + t * ab)) + t * (t * bb + 2.0 * bd), radius + rb)
    for start, radius in ((0.0, b0), (1.0, b1)):
        s = torch.clamp((ad + start * ab) * per_a, 0.0, 1.0)
        found = found | within(dd + s * (s * aa - 2.0 * (ad + start * ab)) + start * (bb + 2.0 * bd), radius + ra)
    # Shafts: the lines' distance, where the nearest points lie on both; a little beyond, for the motion of the step.
    det = aa * bb - ab * ab
    on_a, on_b = ad * bb - bd * ab, ad * ab - bd * aa
    inside = (on_a > -0.1 * det) & (on_a < 1.1 * det) & (on_b > -0.1 * det) & (on_b < 1.1 * det)
    apart = dd * det - ad * on_a + bd * on_b
    return found | (inside & (apart < (ra + rb + reach) * (ra + rb + reach) * det))
