#!/usr/bin/env bash
# Measures what is published about numerical trust, into one folder: nerf check on every path of the adapter, the
# printed equations, the quadrature, PSNR against time, the spread over seeds and repeats, the cost of summing in
# an order.
# usage: scripts/trust.sh OUT [DATASET…]
#   OUT       folder for the results
#   DATASET   trained on for the curves, besides the generated scene toys
# environment:
#   SECONDS_EACH   of the training runs behind the curves [default: 120]
#   NERF_ADAPTER   what --adapter takes
#   NERF, STUDIES  binaries to use instead of building them
set -euo pipefail

if [ $# -lt 1 ]; then
    sed -n '5,11s/^# //p' "$0" >&2
    exit 2
fi
mkdir -p "$1"
out=$(cd "$1" && pwd)
shift
datasets=()
for dataset in "$@"; do
    datasets+=("$(cd "$dataset" && pwd)")
done
cd "$(dirname "$0")/.."
nerf=${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}
studies=("${STUDIES:-}")
if [ -z "${STUDIES:-}" ]; then
    studies=(cargo bench --quiet --locked --bench studies --)
fi
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Mesa's loader complains without it.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}
failed=

# A command on the adapter asked for.
on_adapter() {
    "$nerf" "$@" ${NERF_ADAPTER:+--adapter "$NERF_ADAPTER"} --quiet
}

# A study on that adapter.
study() {
    "${studies[@]}" "$@" --out "$out" ${NERF_ADAPTER:+--adapter "$NERF_ADAPTER"}
}

# One table of nerf check; what the adapter cannot do is said and left out.
check() {
    local name=$1
    shift
    printf 'check %s\n' "$name" >&2
    # What an adapter lacks is an error of another kind than a broken bound.
    { printf '$ nerf check %s\n' "$*" && on_adapter check "$@"; } >"$work/table" 2>&1 \
        || grep -q 'does not have it; \|does not have them; \|those of the adapter\|on a GPU like' "$work/table" || failed=yes
    { cat "$work/table" && echo; } | tee -a "$out/check.txt" >&2
}

: >"$out/check.txt"
check 'the path it takes'
for accumulation in ordered fixed long float exchange; do
    check "$accumulation" --accumulation "$accumulation"
done
check 'buffers' --memory buffers
check 'plain products' --product 1
check 'tiles' --product tiled
for vectors in tests/vectors/*.json; do
    check "$(basename "$vectors")" --vectors "$vectors"
done

study equations >"$work/equations.txt"
study quadrature >"$out/quadrature.txt"

on_adapter generate toys --out "$work/toys" --views 100 --size 100
for dataset in "$work/toys" ${datasets[@]+"${datasets[@]}"}; do
    name=$(basename "$dataset")
    printf 'curves of %s\n' "$name" >&2
    on_adapter bench training "$dataset" --out "$work/curve" --seeds 3 --seconds "${SECONDS_EACH:-120}" \
        | tee "$out/training_$name.txt" >&2
    for kind in json csv svg; do
        # Where the dataset lies is nobody's business.
        sed 's|"dataset": ".*/|"dataset": "|' "$work/curve/training.$kind" >"$out/training_$name.$kind"
    done
done

printf 'spread over seeds, repeats, and ways of summing\n' >&2
on_adapter bench training "$work/toys" --out "$work/seeds" --seeds 5 --steps 600 >"$out/spread_seeds.txt"
on_adapter bench training "$work/toys" --out "$work/repeats" --seconds 30 \
    --seed 0 --seed 0 --seed 0 --seed 0 --seed 0 >"$out/spread_repeats.txt"
sums=()
for accumulation in ordered fixed exchange float; do
    printf '{"accumulation":"%s"}\n' "$accumulation" >"$work/$accumulation.json"
    sums+=(--config "$work/$accumulation.json")
done
on_adapter bench training "$work/toys" --out "$work/sums" "${sums[@]}" --steps 500 --seed 0 >"$out/sums.txt" 2>&1 || {
    # Without float atomics: the rest.
    on_adapter bench training "$work/toys" --out "$work/sums" "${sums[@]:0:6}" --steps 500 --seed 0 >"$out/sums.txt"
}
cat "$out"/spread_*.txt "$out/sums.txt" >&2
[ -z "$failed" ] || { echo "error: nerf check found errors beyond their bounds; see $out/check.txt" >&2 && exit 1; }
