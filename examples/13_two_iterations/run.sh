#!/usr/bin/env bash
# Two iterations of the loop on the rig, in the short profile of `make demo`; run again it goes on where it was.
# Usage: run.sh [DIRECTORY] [SEED ...]   (default: two-iterations, seed 2)
set -euo pipefail
out=${1:-two-iterations}
shift || true
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
exec "${PYTHON:-python}" "$here/run.py" --demo --out "$out" --seeds "${@:-2}"
