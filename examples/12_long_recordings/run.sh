#!/usr/bin/env bash
# A long recording, watched from outside: half an hour of the rig's time; Linux only. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
