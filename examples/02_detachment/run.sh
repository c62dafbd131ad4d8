#!/usr/bin/env bash
# The paper's contact problems with and without detachment: a few minutes. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
