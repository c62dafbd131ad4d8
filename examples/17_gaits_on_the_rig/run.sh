#!/usr/bin/env bash
# What is planned from robot.toml alone, run on the rig: do gaits do there what the simulator says? Options are those of run.py; README.md
set -euo pipefail
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
