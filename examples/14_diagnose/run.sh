#!/usr/bin/env bash
# A planted effect is looked for: a minute. Options are those of run.py; what to expect: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
