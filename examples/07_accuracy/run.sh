#!/usr/bin/env bash
# How accurate the engine is: three minutes. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
