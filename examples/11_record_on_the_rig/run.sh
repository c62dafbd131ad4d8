#!/usr/bin/env bash
# A robot on the desk, calibrated, driven and recorded: a minute or two. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
