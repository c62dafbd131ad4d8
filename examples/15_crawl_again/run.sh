#!/usr/bin/env bash
# The real crawl, diagnosed again under noise that is drawn anew. Options are those of run.py; what comes out: README.md
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
