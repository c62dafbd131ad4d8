"""Artifacts damaged in every way that happens: by disks, copies, editors and other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import h5py
import numpy as np

Bytes = Callable[[bytearray, Random], None]
Edit = Callable[[h5py.File, str, Random], None]


def _flip(data: bytearray, random: Random) -> None:
    for _ in range(random.choice([1, 1, 3, 20])):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)


def _cut(data: bytearray, random: Random) -> None:
    del data[random.randrange(len(data)) :]


def _zero(data: bytearray, random: Random) -> None:
    start = random.randrange(len(data))
    stop = min(len(data), start + random.randrange(1, 4096))
    data[start:stop] = bytes(stop - start)


def _insert(data: bytearray, random: Random) -> None:
    place = random.randrange(len(data))
    data[place:place] = random.randbytes(random.randrange(1, 64))


def _swap(data: bytearray, random: Random) -> None:
    one, two = (random.randrange(len(data) // 512) * 512 for _ in range(2))
    data[one : one + 512], data[two : two + 512] = data[two : two + 512], data[one : one + 512]


def _replace(file: h5py.File, path: str, values: object, **options: object) -> None:
    """Another dataset under the same name, with the same attributes."""
    kept = dict(file[path].attrs)
    del file[path]
    file.create_dataset(path, data=values, **options).attrs.update(kept)


def _rename(file: h5py.File, path: str, random: Random) -> None:
    file.move(path, path + "x")


def _delete(file: h5py.File, path: str, random: Random) -> None:
    del file[path]


def _dtype(file: h5py.File, path: str, random: Random) -> None:
    values = np.asarray(file[path][()])
    with np.errstate(over="ignore"):  # what does not fit becomes inf: damage as well
        _replace(file, path, values.astype("f2") if values.dtype.kind in "fiub" else 3)


def _shape(file: h5py.File, path: str, random: Random) -> None:
    _replace(file, path, np.asarray(file[path][()])[None])


def _unit(file: h5py.File, path: str, random: Random) -> None:
    file[path].attrs["unit"] = random.choice(["mm", "", "m/s"])


def _nan(file: h5py.File, path: str, random: Random) -> None:
    values = np.array(file[path][()])
    if values.dtype.kind == "f" and values.size:
        values.flat[random.randrange(values.size)] = random.choice([np.nan, np.inf, -1e300])
        file[path][...] = values


def _link(file: h5py.File, path: str, random: Random) -> None:
    del file[path]
    file[path] = random.choice([h5py.SoftLink("/nowhere"), h5py.ExternalLink("other.h5", "/x"), h5py.SoftLink("/")])


def _text(file: h5py.File, path: str, random: Random) -> None:
    _replace(file, path, ["a", "b"], dtype=h5py.string_dtype())


def _attribute(file: h5py.File, path: str, random: Random) -> None:
    file[path].attrs["dims"] = np.array([1, 2])


OF_BYTES: dict[str, Bytes] = {"flip": _flip, "cut": _cut, "zero": _zero, "insert": _insert, "swap": _swap}
OF_CONTENT: dict[str, Edit] = {
    "rename": _rename, "delete": _delete, "dtype": _dtype, "shape": _shape, "unit": _unit, "nan": _nan, "link": _link,
    "text": _text, "attribute": _attribute,
}  # fmt: skip
KINDS_OF_DAMAGE = ("flip",) * 5 + tuple(OF_BYTES) + tuple(OF_CONTENT)
"""What to choose from; flipped bits are what disks and memory do most."""


def mutate(path: Path, damage: str, random: Random) -> None:
    """Damage one file in place."""
    if damage in OF_BYTES:
        data = bytearray(path.read_bytes())
        OF_BYTES[damage](data, random)
        path.write_bytes(data)
        return
    found: list[str] = []
    with h5py.File(path, "r+") as file:
        file.visititems(lambda name, node: found.append(name) if isinstance(node, h5py.Dataset) else None)
        OF_CONTENT[damage](file, random.choice(sorted(found)), random)
