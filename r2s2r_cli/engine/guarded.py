"""Calls that most steps skip: run where a condition holds, at the price of a branch where it does not.

Written for what is rare and large, such as the contact of two rods. In machine code a guarded function is one shared
subroutine, however often it is called.
"""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor

from r2s2r_cli.engine.native.symbolic import Symbolic, guarded_call


def guarded(
    when: Tensor, fn: Callable[..., tuple[Tensor, ...]], inputs: tuple[Tensor, ...], otherwise: tuple[Tensor, ...]
) -> tuple[Tensor, ...]:
    """fn(*inputs) for the elements of the batch where `when` (B,) holds, else `otherwise`, bit for bit.

    All tensors have the batch axis first; those of batch 1 are shared. `fn` must take every tensor it reads through
    `inputs`, return as many tensors as `otherwise` has, of the same shapes, treat the elements of the batch alike, and
    call no guarded function itself. Elements where `when` is false give no gradient to `inputs`, and cannot spoil one:
    `fn` never sees them.
    """
    if any(isinstance(x, Symbolic) for x in (when, *inputs, *otherwise)):
        return guarded_call(when, fn, inputs, otherwise)
    batch, chosen = len(when), when.nonzero()[:, 0]
    otherwise = tuple(old.expand(batch, *old.shape[1:]) for old in otherwise)
    if not len(chosen):
        return otherwise
    results = fn(*(x[chosen] if len(x) == batch else x for x in inputs))
    return tuple(old.index_put((chosen,), new) for old, new in zip(otherwise, results, strict=True))
