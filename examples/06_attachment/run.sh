#!/usr/bin/env bash
# Cables at the rod ends against cables on the caps: a minute. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
