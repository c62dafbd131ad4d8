"""Long recordings go through the store without being held in memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

MEGABYTES = 200
ALLOWED_MB = 60
"""Blocks of 1 to 4 MB, HDF5's caches and the allocator; a copy of the images would be 200."""

SCRIPT = """
import json, resource, sys
from pathlib import Path
import numpy as np
from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.store.journal import Journal
from r2s2r_cli.store.migrate import migrate_file
from r2s2r_cli.store.read import iter_blobs, read_artifact
from r2s2r_cli.store.seal import seal
from r2s2r_cli.store.write import write_artifact
from tests.support import recorder
from tests.support.builders import provenance, recording

folder, count = Path(sys.argv[1]), int(sys.argv[2])
frame = np.random.default_rng(0).bytes(1_000_000)
warm = write_artifact(folder / "warm.h5", recording(), provenance())
read_artifact(folder / "warm.h5", blobs=True)

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

figures = {"start": peak()}
run = recording().groups["runs/walk"]
camera = Group({"t": np.arange(float(count)), "color": Blobs((frame for _ in range(count)), count)},
               {"width": 1, "height": 1})
data = ArtifactData("recording", {"runs/walk": run, "runs/walk/camera": camera})
write_artifact(folder / "big.h5", data, provenance())
figures["written"] = peak()
header, back = read_artifact(folder / "big.h5", blobs=True)
seen = sum(len(image) for image in back.groups["runs/walk/camera"].datasets["color"].items)
figures["read"] = peak()
write_artifact(folder / "copy.h5", back, provenance(), content_sha256=header.content_sha256)
figures["copied"] = peak()
(folder / "big.h5").unlink()
(folder / "copy.h5").unlink()
with Journal(folder / "x.h5.journal", recorder.head()) as journal:
    for number in range(count):
        journal.append(recorder.COLOR, {"t": float(number), "color": frame})
seal(folder / "x.h5.journal", folder / "x.h5")
figures["sealed"] = peak()
print(json.dumps({"peaks": figures, "seen": seen, "size": (folder / "x.h5").stat().st_size}))
"""


@pytest.mark.slow
def test_a_long_recording_streams(tmp_path: Path) -> None:
    """Writing, reading, copying and sealing 200 MB of images raises the peak memory by far less than that."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path), str(MEGABYTES)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["seen"] == MEGABYTES * 1_000_000 < answer["size"]
    grown = {name: peak - answer["peaks"]["start"] for name, peak in answer["peaks"].items()}
    assert max(grown.values()) < ALLOWED_MB, grown
