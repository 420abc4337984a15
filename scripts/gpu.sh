#!/usr/bin/env bash
# Everything about nerf on one machine's GPU in one call of nine minutes: what the adapter is and can do, whether the
# kernels are right, where the time of a step goes, and how good trainings are after 1.5, 4, 12 and 60 s. What matters
# most comes first, each part has its own time limit, and what is known is in RESULTS after every part. A part that fails
# is told and does not stop the next. Runs in the folder that scripts/bundle.sh packed, without network or toolchain.
# usage: gpu.sh RESULTS
#   RESULTS   folder for results.tar.gz and summary.txt
# exit code: 1 if a kernel is wrong, 2 if a part failed or did not run, else 0
# environment:
#   NERF_ADAPTER  what --adapter takes
#   SECONDS_ALL   of the whole call [default: 540]
#   REHEARSAL     1: tiny budgets, to try this script on a CPU
#   FAIL, HANG    names of parts that fail, or hang, to try what happens then
#   LIMIT         seconds of any part at most, to try that sooner
set -uo pipefail

# Names of the parts, seconds that they are given at most, and seconds without which they are not begun. Sweeps and
# trainings carry their values in their names.
parts='
adapters             15   3
ceilings             40   8
check                60  10
check_exchange       60  10
check_fixed          60  10
scene                60   8
step                 75  30
train_lego_12s       40  18
train_lego_4s        30   9
train_lego_1.5s      30   6
train_lego_60s       90  66
render               20   4
train_fox_12s        40  18
train_scene_12s      40  18
train_scene_4s       30   9
train_scene_1.5s     30   6
deterministic        45   8
train_lego_12s_seed1 40  18
train_lego_12s_seed2 40  18
sweep_kept_16        25   9
sweep_kept_17        25   9
sweep_kept_19        25   9
sweep_table_17       25   9
sweep_table_21       25   9
sweep_width_32       25   9
kernels              60  10
train_scene_60s      90  66
'

if [ $# -lt 1 ]; then
    sed -n '6,15s/^# //p' "$0" >&2
    exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
bin=$here/bin
mkdir -p "$1" || exit 2
results=$(cd "$1" && pwd)
# As a part of an earlier call, below; else a folder of this one.
work=${NERF_WORK:-$(mktemp -d)}
out=$work/results
export NERF_WORK=$work
mkdir -p "$out"
cd "$here" || exit 2
# Mesa's loader complains without it.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}
export RUST_BACKTRACE=0

# Sizes and times: those of a measurement, or those of a rehearsal.
if [ -z "${REHEARSAL:-}" ]; then
    views=60 size=800 time_factor=1 warm=10 measured=10 ceiling_seconds=0.3 steps=500
    batch=() photos=()
else
    views=20 size=100 time_factor=0.25 warm=1 measured=1 ceiling_seconds=0.02 steps=20
    photos=(--downscale 4)
    batch=(--set batch.kept=8192 --set batch.samples=32768 --set batch.rays=4096 --set grid.log2_table=15)
fi

# A command on the adapter asked for.
on_adapter() {
    "$@" ${NERF_ADAPTER:+--adapter "$NERF_ADAPTER"}
}

nerf() {
    on_adapter "$bin/nerf" "$@" --quiet --json
}

scaled() {
    awk "BEGIN { print $1 * $time_factor }"
}

part_adapters() {
    nerf adapters >"$out/adapters.json" || return
    {
        uname -srm
        sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo | head -n 1
        printf '%s cores\n' "$(nproc)"
        grep MemTotal /proc/meminfo
        if command -v nvidia-smi >/dev/null; then
            nvidia-smi --query-gpu=name,driver_version,memory.total,clocks.max.sm,clocks.max.mem --format=csv
        fi
    } >"$out/machine.txt"
}

part_ceilings() {
    on_adapter "$bin/ceilings" --seconds "$ceiling_seconds" --json --out "$out/ceilings.json"
}

part_check() {
    nerf check >"$out/check.json"
}

part_check_exchange() {
    nerf check --accumulation exchange >"$out/check_exchange.json"
}

part_check_fixed() {
    nerf check --accumulation fixed >"$out/check_fixed.json"
}

part_scene() {
    "$bin/nerf" generate toys --out "$work/data/scene" --views "$views" --size "$size" --quiet
}

# The step benchmark; $1 names the result.
step() {
    local name=$1 ceilings=()
    shift
    [ ! -e "$out/ceilings.json" ] || ceilings=(--ceilings "$out/ceilings.json")
    on_adapter "$bin/step" --config gpu --dataset "$work/data/scene" ${batch[@]+"${batch[@]}"} "$@" \
        ${ceilings[@]+"${ceilings[@]}"} --out "$out/$name.json"
}

part_step() {
    step step --warm "$warm" --seconds "$measured"
}

# sweep_SETTING_VALUE
part_sweep() {
    local setting value
    IFS=_ read -r _ setting value <<<"$1"
    case $setting in
    kept) set -- --set batch.kept=$((1 << value)) --set batch.samples=$((4 << value)) ;;
    table) set -- --set "grid.log2_table=$value" ;;
    width) set -- --set "network.width=$value" ;;
    esac
    step "sweep_${setting}_$value" "$@" --warm "$(scaled 3)" --seconds "$(scaled 3)" --no-start
}

# A training and its score on all test views: the result's name, the dataset, and what else train takes.
train() {
    local name=$1 dataset=$2
    shift 2
    nerf train "$dataset" --out "$work/$name" --overwrite --eval-all "$@" >"$out/$name.json" || return
    cp "$work/$name/log.jsonl" "$out/$name.log.jsonl"
}

# train_DATASET_TIMEs, or train_DATASET_TIMEs_seedK
part_train() {
    local dataset seconds seed folder
    IFS=_ read -r _ dataset seconds seed <<<"$1"
    folder=$work/data/scene
    [ "$dataset" = scene ] || folder=$(find "$here/data" -maxdepth 1 -name "${dataset}_*" | head -n 1)
    [ -n "$folder" ] || { printf 'the bundle has no %s\n' "$dataset" >&2 && return 1; }
    seed=${seed#seed}
    train "$1" "$folder" ${photos[@]+"${photos[@]}"} --seconds "$(scaled "${seconds%s}")" --seed "${seed:-0}"
}

part_render() {
    local name
    for name in train_lego_60s train_lego_12s train_scene_12s; do
        if [ -e "$work/$name/checkpoint.safetensors" ]; then
            nerf render "$work/$name" --orbit 6 --width "$size" --height "$size" --out "$out/views" >"$out/render.json"
            return
        fi
    done
    printf 'no training to render\n' >&2
    return 1
}

part_deterministic() {
    local run
    for run in deterministic_1 deterministic_2; do
        train "$run" "$work/data/scene" --deterministic --steps "$steps" || return
    done
    if cmp "$work"/deterministic_[12]/checkpoint.safetensors >&2; then
        printf 'the same, bit for bit\n' >"$out/deterministic.txt"
    else
        printf 'different\n' >"$out/deterministic.txt"
        return 1
    fi
}

part_kernels() {
    "$bin/kernels" >"$out/kernels.txt" 2>&1
}

# Runs one part, in a process of its own.
if [ $# -eq 2 ] && [ -n "${NERF_PART:-}" ]; then
    case $2 in
    "${FAIL:-}") exit 1 ;;
    "${HANG:-}") sleep 3600 ;;
    train_* | sweep_*) "part_${2%%_*}" "$2" ;;
    *) "part_$2" ;;
    esac
    exit
fi

say() {
    printf '%s\n' "$*" | tee -a "$out/summary.txt" >&2
}

# Puts all that is known into RESULTS; the archive is there whole at any time.
archive() {
    tar -C "$out" -czf "$results/.results.tar.gz" . && mv "$results/.results.tar.gz" "$results/results.tar.gz"
    cp "$out/summary.txt" "$results/summary.txt"
    # What brings it back may refuse larger files.
    if [ "$(stat -c %s "$results/results.tar.gz")" -gt $((15 << 20)) ] && [ -d "$out/views" ]; then
        rm -r "$out/views"
        say 'the pictures are left out: the archive was larger than 15 MiB'
        archive
    fi
}

# Looks for a driver: with the machine's own loader, then with the bundle's, then in other places. Takes the first
# attempt that finds a GPU, else the first that finds anything.
find_driver() {
    local found attempt icds library=$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
    icds=$(find /usr /etc /opt -path '*/vulkan/icd.d/*.json' 2>/dev/null | paste -sd: -)
    for kind in '"kind":"[A-Za-z]*Gpu"' '"kind"'; do
        for attempt in "" "LD_LIBRARY_PATH=$library" "LD_LIBRARY_PATH=$library VK_DRIVER_FILES=$icds"; do
            # shellcheck disable=SC2086
            found=$(env $attempt timeout 20 "$bin/nerf" adapters --json 2>/dev/null)
            if grep -q "$kind" <<<"$found"; then
                # shellcheck disable=SC2163
                for variable in $attempt; do export "$variable"; done
                say "driver: ${attempt:-found by the loader of this machine}"
                return
            fi
        done
    done
    say 'driver: none found'
}

# Whether a result says that a kernel is wrong.
is_wrong() {
    case $1 in
    check*) grep -q '"pass":false' "$out/$1.json" 2>/dev/null ;;
    kernels) grep -q '^test result: FAILED' "$out/kernels.txt" 2>/dev/null ;;
    *) false ;;
    esac
}

# One line of a part's result for the summary.
digest() {
    local key
    for key in psnr ssim steps; do
        grep -o "\"$key\":[0-9a-z.]*" "$out/$1.json" 2>/dev/null | head -n 1
    done | tr -d '"' | awk -F: '{ printf "%s%s %.4g", sep, $1, $2; sep = ", " }'
}

# Why a part did not end well, in one line: nerf tells it in JSON, others on stderr.
reason() {
    {
        grep -o '"error":.*' "$out/$1.json" 2>/dev/null | sed 's/^"error":"//; s/"}*$//; s/^error: //'
        grep -i error "$out/$1.err" 2>/dev/null
        tail -n 1 "$out/$1.err" 2>/dev/null
    } | sed 's/\\n.*//' | tr '\t' ' ' | grep -m 1 .
}

begin=$SECONDS
most=${SECONDS_ALL:-540}
wrong='' failed=''
{
    cat BUNDLE 2>/dev/null
    printf 'date %s\nrehearsal %s\nseconds %s\n' "$(date -u +%F)" "${REHEARSAL:-0}" "$most"
} >"$out/meta.txt"
: >"$out/summary.txt"
awk 'NF { print $1 }' <<<"$parts" >"$out/planned.txt"
printf 'part\tstatus\tcode\tseconds\treason\n' >"$out/parts.tsv"
find_driver
while read -r name limit least; do
    [ -n "$name" ] || continue
    limit=$((limit < ${LIMIT:-600} ? limit : ${LIMIT:-600}))
    # The last seconds are for the archive.
    left=$((most - 5 - (SECONDS - begin)))
    if [ "$left" -lt "$(awk "BEGIN { print int($least * $time_factor) }")" ]; then
        status=skipped code=- took=0
    else
        start=$SECONDS
        NERF_PART=$name timeout -k 5 $((limit < left ? limit : left)) "$here/gpu.sh" "$results" "$name" \
            </dev/null >"$out/$name.out" 2>"$out/$name.err"
        code=$? took=$((SECONDS - start))
        case $code in
        0) status='done' ;;
        124 | 137) status=timeout ;;
        *) status=failed ;;
        esac
        is_wrong "$name" && status=wrong
    fi
    case $status in
    'done') ;;
    wrong) wrong=yes ;;
    *) failed=yes ;;
    esac
    why=
    [ "$status" = 'done' ] || [ "$status" = skipped ] || why=$(reason "$name")
    printf '%s\t%s\t%s\t%s\t%s\n' "$name" "$status" "$code" "$took" "$why" >>"$out/parts.tsv"
    say "$(printf '%4d s  %-21s %-8s %s' $((SECONDS - begin)) "$name" "$status" "$(digest "$name")")"
    [ -z "$why" ] || say "        $why"
    find "$out" -maxdepth 1 \( -name '*.out' -o -name '*.err' \) -empty -delete
    archive
done <<<"$parts"
rm -rf "$work"
[ -z "$wrong" ] || { printf 'error: kernels are wrong; see summary.txt\n' >&2 && exit 1; }
[ -z "$failed" ] || exit 2
