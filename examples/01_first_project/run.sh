#!/usr/bin/env bash
# A first project: a labelled kinematic sample, and the real crawl where it is on this machine.
# Usage: run.sh [DIRECTORY]   (default: demo). Run again, it says that everything is fresh.
set -euo pipefail
demo=${1:-demo}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
real=${R2S2R_REAL_DIR:-$here/../../../shared/real}

step() { echo; echo "\$ r2s2r $*"; r2s2r "$@"; }

echo "== the sample: closed-form kinematics, no physics"
[ -f "$demo/sample/project.toml" ] || step init "$demo/sample" --sample
cd "$demo/sample"
step import sample.csv
step estimate
step simulate --random 4 --seed 1
step validate
step status
step export iterations/001/20-estimate.h5 --to csv --out exported --force --quiet >/dev/null
echo
echo "look at: $demo/sample/iterations/001/20-estimate.html"
echo "look at: $demo/sample/iterations/001/simulation.html"
cd - >/dev/null

if [ ! -d "$real" ]; then
    echo
    echo "== no real measurements at R2S2R_REAL_DIR or ../shared/real: the real crawl is left out"
    exit 0
fi
real=$(cd "$real" && pwd)
echo
echo "== the real crawl of the 3-bar robot"
[ -f "$demo/crawl/project.toml" ] || step init "$demo/crawl"
cd "$demo/crawl"
step calibrate --points "$real/tribar_calibration/length_capacitance_points.csv" \
    --history "$real/tribar_calibration/calibration_history_2025.json"
step import "$real/tribar_crawl/crawl.csv"
step estimate
step simulate --replay crawl
# One fit; without these two the range over starts and the profiles are studied as well, which takes minutes.
step identify --train crawl:1-7 --test crawl:8-11 --starts 1 --set identify.profiles=0
step validate
step status
echo
echo "look at: $demo/crawl/calibration.html"
echo "look at: $demo/crawl/iterations/001/20-estimate.html"
echo "look at: $demo/crawl/iterations/001/simulation.html"
echo "look at: $demo/crawl/iterations/001/30-identify.html"
