"""How bytes leave the rig: a pty, TCP, UDP; and what happens to them on the way (the wire faults of the world file)."""

from r2s2r_cli.rig.transport.base import Event as Event, LineBuffer as LineBuffer, Transport as Transport
from r2s2r_cli.rig.transport.choose import LINKS as LINKS, open_transport as open_transport
