#!/usr/bin/env bash
# Identification as a library: a minute. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
