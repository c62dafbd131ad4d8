"""The world file: everything about the rig that the rest of r2s2r must not know. Read by the rig alone.

`load_world(path)` gives a `World`; every key has a default, an unknown key is an error. Reference:
docs/reference/world.md.
"""

from r2s2r_cli.rig.world.device import Boards as Boards, Inertial as Inertial, Sensors as Sensors
from r2s2r_cli.rig.world.faults import Fault as Fault, Timed as Timed, Wire as Wire
from r2s2r_cli.rig.world.file import Floor as Floor, Start as Start, World as World, load_world as load_world
