#!/usr/bin/env bash
# The paper's turning on an uneven floor: about ten minutes; run again it goes on where it was. Usage: run.sh [DIRECTORY]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
exec "${PYTHON:-python}" "$here/uneven.py" --out "${1:-uneven-floor}"
