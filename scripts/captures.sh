#!/usr/bin/env bash
# Measures captures, one binary after the other in every round: test PSNR of all views, near share, marched samples per ray
# at the end, steps, and seconds per view rendered and measured.
# usage: scripts/captures.sh DATA OUT [NAME=NERF …]
#   DATA      folder that holds the datasets
#   OUT       folder for captures.jsonl and captures.md; rows are added as they are known
#   NAME=NERF binaries to compare [default: new=target/release/nerf]
# environment:
#   ROWS      what to train: "dataset:seconds[:downscale of what is measured] …"
#   SEEDS     [default: 0 1 2]
# needs jq
set -euo pipefail

if [ $# -lt 2 ] || [ ! -d "$1" ] || ! command -v jq >/dev/null; then
    sed -n '4,11s/^# //p' "$0" >&2
    exit 2
fi
data=$(cd "$1" && pwd)
mkdir -p "$2"
out=$(cd "$2" && pwd)
shift 2
cd "$(dirname "$0")/.."
binaries=("${@:-new=${CARGO_TARGET_DIR:-target}/release/nerf}")
rows=${ROWS:-can_270x480:60 can_270x480:180 fruit_302x403:60 fruit_302x403:180 fox_270x480:60 fox_270x480:600 stitch_200:300}
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A row of captures.jsonl.
measure() {
    local name=$1 nerf=$2 dataset=$3 seconds=$4 downscale=$5 seed=$6 begun
    printf '%s: %s for %s s, seed %s\n' "$name" "$dataset" "$seconds" "$seed" >&2
    "$nerf" train "$data/$dataset" --out "$work/run" --overwrite --no-eval --seconds "$seconds" --seed "$seed" --quiet
    begun=$(date +%s.%N)
    "$nerf" eval "$work/run" "$data/$dataset" --downscale "$downscale" --json --quiet >"$work/scores.json"
    jq -c -s --arg name "$name" --arg dataset "$dataset" --argjson seconds "$seconds" --argjson seed "$seed" \
        --argjson downscale "$downscale" --argjson took "$(echo "$(date +%s.%N) - $begun" | bc)" \
        --slurpfile scores "$work/scores.json" '
        [.[] | select(.marched)] as $steps | $steps[-1] as $last
        | {name: $name, dataset: $dataset, seconds: $seconds, seed: $seed, downscale: $downscale,
           psnr: $scores[0].psnr, ssim: $scores[0].ssim, near_share: $scores[0].near_share,
           views: ($scores[0].views | length), marched_per_ray: ($last.marched / $last.rays), steps: $last.step,
           seconds_per_view: ($took / ($scores[0].views | length))}' "$work/run/log.jsonl" >>"$out/captures.jsonl"
}

for seed in ${SEEDS:-0 1 2}; do
    for row in $rows; do
        IFS=: read -r dataset seconds downscale <<<"$row"
        for binary in "${binaries[@]}"; do
            measure "${binary%%=*}" "${binary#*=}" "$dataset" "$seconds" "${downscale:-1}" "$seed"
        done
    done
done

jq -r -s '
    def mean: add / length;
    def rounded(digits): . * pow(10; digits) | round / pow(10; digits);
    "| dataset | s | measured at | binary | seeds | PSNR, dB (least to most) | near share, most | marched/ray | steps | s/view |",
    "| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    (group_by([.dataset, .seconds, .downscale, .name])[]
        | "| \(.[0].dataset) | \(.[0].seconds) | 1/\(.[0].downscale) | \(.[0].name) | \(length) | "
          + "\(map(.psnr) | mean | rounded(2)) (\(map(.psnr) | min | rounded(2)) to \(map(.psnr) | max | rounded(2))) | "
          + "\(map(.near_share) | max | if . == null then "not told" else rounded(4) end) | "
          + "\(map(.marched_per_ray) | mean | rounded(1)) | \(map(.steps) | mean | round) | "
          + "\(map(.seconds_per_view) | mean | rounded(2)) |")' "$out/captures.jsonl" >"$out/captures.md"
