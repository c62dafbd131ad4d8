#!/usr/bin/env bash
# Each effect beyond the catalogue, on the rig and named to the diagnosis: an hour on two cores; run again it goes on. Usage: run.sh [DIRECTORY]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
out=${1:-further-effects}
for what in make look; do
    "${PYTHON:-python}" "$here/further.py" "$what" "$out" --part 1/2 &
    "${PYTHON:-python}" "$here/further.py" "$what" "$out" --part 2/2
    wait $!
done
exec "${PYTHON:-python}" "$here/further.py" tell "$out"
