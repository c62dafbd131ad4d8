#!/usr/bin/env bash
# The rig's camera: half a minute. Options are those of run.py; what it prints: expected.txt
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
