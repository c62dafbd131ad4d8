"""The device's side of the three protocols of docs/reference/protocols.md. The host's side is code of its own."""

from r2s2r_cli.rig.wire.base import (
    BoardReading as BoardReading,
    DeviceCodec as DeviceCodec,
    Line as Line,
    Motors as Motors,
    Received as Received,
)
from r2s2r_cli.rig.wire.choose import PROTOCOLS as PROTOCOLS, device_codec as device_codec
