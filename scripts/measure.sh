#!/usr/bin/env bash
# Measures everything that is published: trains on each dataset, evaluates on all test views over black, runs
# the step benchmark, and writes a JSON and a Markdown file named by date and adapter.
# usage: scripts/measure.sh DATA [RESULTS]
#   DATA      folder that holds the datasets; one that is missing is left out
#   RESULTS   folder for the two files [default: benches/results]
# environment:
#   ROWS      what to train: "dataset:seconds …"
#   BENCHES   presets of benches/step
#   NERF_ADAPTER  what --adapter takes
#   NERF, STEP    binaries to use instead of building them
set -euo pipefail

if [ $# -lt 1 ] || [ ! -d "$1" ]; then
    sed -n '4,11s/^# //p' "$0" >&2
    exit 2
fi
data=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
results=${2:-benches/results}
mkdir -p "$results"
results=$(cd "$results" && pwd)
rows=${ROWS:-lego_100:60 lego_100:300 lego_200:300 fox_270x480:600 stitch_200:300}
nerf=${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}
step=("${STEP:-}")
if [ -z "${STEP:-}" ]; then
    step=(cargo bench --quiet --locked --bench step --)
fi
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A command on the adapter asked for.
on_adapter() {
    "$@" ${NERF_ADAPTER:+--adapter "$NERF_ADAPTER"}
}

# The first value of a key in one line of JSON on stdin.
value() {
    awk -v key="\"$1\":" '{
        at = index($0, key)
        if (!at) { print "error: no " key " in " $0 > "/dev/stderr"; exit 1 }
        rest = substr($0, at + length(key))
        if (rest ~ /^"/) { sub(/^"/, "", rest); sub(/".*/, "", rest) } else sub(/[],}].*/, "", rest)
        print rest
    }'
}

# Trains and evaluates; one line of JSON and one of Markdown.
measure() {
    local name=$1 seconds=$2 run=$work/run trained scored samples views
    printf '%s for %s s\n' "$name" "$seconds" >&2
    trained=$(on_adapter "$nerf" train "$data/$name" --out "$run" --seconds "$seconds" --overwrite --no-eval \
        --quiet --json)
    scored=$(on_adapter "$nerf" eval "$run" "$data/$name" --background black --quiet --json)
    samples=$(awk -F'"samples":' 'NF > 1 { sub(/,.*/, "", $2); sum += $2 } END { printf "%.0f", sum }' \
        "$run/log.jsonl")
    views=$(grep -o '"file":' <<<"$scored" | wc -l)
    local used steps psnr ssim
    used=$(value seconds <<<"$trained")
    steps=$(value steps <<<"$trained")
    psnr=$(value psnr <<<"$scored")
    ssim=$(value ssim <<<"$scored")
    printf '{"dataset":"%s","seconds":%.1f,"steps":%d,"samples":%s,"psnr":%.3f,"ssim":%.4f,"views":%d}\n' \
        "$name" "$used" "$steps" "$samples" "$psnr" "$ssim" "$views" >>"$work/rows.json"
    printf '| %s | %.0f | %d | %.1f M | %.2f | %.4f | %d |\n' \
        "$name" "$used" "$steps" "$(awk "BEGIN { print $samples / 1e6 }")" "$psnr" "$ssim" "$views" \
        | tee -a "$work/rows.md" >&2
}

# Lines joined by commas.
joined() {
    paste -sd, "$1"
}

touch "$work/rows.json" "$work/rows.md"
for preset in ${BENCHES:-full cpu}; do
    printf 'step benchmark, %s\n' "$preset" >&2
    on_adapter "${step[@]}" --config "$preset" --out "$work/bench.json" >"$work/bench.txt"
    cat "$work/bench.json" >>"$work/benches.json"
    { cat "$work/bench.txt" && echo; } | tee -a "$work/benches.txt" >&2
done
for row in $rows; do
    name=${row%:*}
    if [ -e "$data/$name" ]; then
        measure "$name" "${row#*:}"
    else
        printf 'left out: there is no %s\n' "$name" >&2
    fi
done

date=$(date -u +%F)
commit=$(git rev-parse --short HEAD 2>/dev/null || echo unknown)
if [ -n "$(git status --porcelain 2>/dev/null)" ]; then
    commit="$commit with changes"
fi
device=$(value adapter <"$work/bench.json")
driver=$(value driver <"$work/bench.json")
cpu=$(sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo 2>/dev/null | head -n 1 | tr -d '"\\' || true)
machine="${cpu:-$(uname -m)}, $(getconf _NPROCESSORS_ONLN) cores, $(uname -s)"
slug=$(tr '[:upper:]' '[:lower:]' <<<"${device%%(*}" | tr -cs 'a-z0-9\n' '-' | sed 's/^-*//; s/-*$//')
file=$results/${date}_$slug

printf '{"date":"%s","commit":"%s","machine":"%s","adapter":"%s","driver":"%s",\n"rows":[%s],\n"benches":[%s]}\n' \
    "$date" "$commit" "$machine" "$device" "$driver" \
    "$(joined "$work/rows.json")" "$(joined "$work/benches.json")" >"$file.json"
cat >"$file.md" <<END
# $device, $date

- Machine: $machine
- Adapter: $device, driver $driver
- Commit: $commit
- Command: \`scripts/measure.sh DATA\`${ROWS:+ with \`ROWS=…\` ($ROWS)}

PSNR and SSIM are means over all test views on black; seconds are of training alone.

| dataset | seconds | steps | samples | PSNR, dB | SSIM | views |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
$(cat "$work/rows.md")

\`\`\`text
$(cat "$work/benches.txt")
\`\`\`
END
printf '%s\n' "$file.json" "$file.md"
