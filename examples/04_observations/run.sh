#!/usr/bin/env bash
# Noisy late and early observations, and contradicting gradients: seconds. Options are those of run.py; what it prints: expected.txt
set -euo pipefail
exec "${PYTHON:-python}" "$(dirname "${BASH_SOURCE[0]}")/run.py" "$@"
