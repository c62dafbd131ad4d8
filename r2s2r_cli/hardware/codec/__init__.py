"""The protocols of docs/reference/protocols.md, the host's side: bytes to values and back. No port, no clock.

The rig has codecs of its own. The two sides share that page and no code.
"""

from __future__ import annotations

from collections.abc import Callable

from r2s2r_cli.errors import UsageError
from r2s2r_cli.hardware.codec.base import Codec
from r2s2r_cli.hardware.codec.boards import BoardsCodec
from r2s2r_cli.hardware.codec.checked import CheckedCodec
from r2s2r_cli.hardware.codec.legacy import LegacyCodec

PROTOCOLS: dict[str, Callable[..., Codec]] = {"checked": CheckedCodec, "boards": BoardsCodec, "legacy": LegacyCodec}


def codec(protocol: str, *, sensors: int, motors: int) -> Codec:
    """The codec of a protocol by name. Raises UsageError for an unknown one, or a robot that it cannot carry."""
    if protocol not in PROTOCOLS:
        raise UsageError("there is no such protocol", where="--protocol", expected=", ".join(PROTOCOLS),
                         received=protocol, hint="--protocol checked")  # fmt: skip
    return PROTOCOLS[protocol](sensors=sensors, motors=motors)
