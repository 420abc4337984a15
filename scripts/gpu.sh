#!/usr/bin/env bash
# One call on a GPU machine that has no toolchain: lists the adapters, runs the kernel tests, checks and measures.
# usage: OUT=FOLDER scripts/gpu.sh BINARIES [DATA]
#   BINARIES  folder with nerf, step (benches/step) and, if the kernels shall be tested, kernels (tests/kernels)
#   DATA      folder with datasets [default: the scene toys is generated]
# environment: NERF_ADAPTER, ROWS and BENCHES as for scripts/measure.sh
set -euo pipefail

if [ $# -lt 1 ] || [ ! -x "$1/nerf" ]; then
    sed -n '3,6s/^# //p' "$0" >&2
    exit 2
fi
binaries=$(cd "$1" && pwd)
out=${OUT:-gpu-results}
mkdir -p "$out"
out=$(cd "$out" && pwd)
export NERF=$binaries/nerf STEP=$binaries/step BENCHES=${BENCHES:-full gpu}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$NERF" adapters
"$NERF" adapters --json >"$out/adapters.json"
failed=
if [ -x "$binaries/kernels" ]; then
    "$binaries/kernels" 2>&1 | tee "$out/kernels.txt" || failed=yes
fi
if [ $# -gt 1 ]; then
    data=$2
    export ROWS=${ROWS:-lego_100:60 lego_800:180}
else
    data=$work
    export ROWS=${ROWS:-toys:60}
    "$NERF" generate toys --out "$work/toys" --size 400
fi
"$(dirname "$0")/trust.sh" "$out/trust" || failed=yes
"$(dirname "$0")/measure.sh" "$data" "$out"
[ -z "$failed" ] || { echo "error: kernels are wrong; see kernels.txt and trust/check.txt" >&2 && exit 1; }
