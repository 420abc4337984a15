#!/usr/bin/env bash
# Everything about nerf on one machine's GPU in one call of nine minutes: what the adapter is and can do, whether the
# kernels are right, where the time of a step goes, and how good training runs are after 1.5, 4, 12 and 60 s. What matters
# most comes first, each part has its own time limit, and what is known is in RESULTS after every part. A part that fails
# is told and does not stop the next. Runs in the folder that scripts/bundle.sh packed, without network or toolchain: with
# bash, coreutils, grep, sed, tar and gzip.
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
unset CDPATH
# Whoever listens may go away: a pipe, a terminal.
trap '' PIPE HUP

# Names of the parts, seconds that they are given at most, and seconds without which they are not begun. Sweeps and
# training runs carry their values in their names.
parts=(
    'adapters             20   3'
    'ceilings             40   8'
    'check                60  10'
    'train_lego_1.5s      30   6'
    'train_lego_4s        30   9'
    'train_lego_12s       40  18'
    'scene               120   8'
    'step                 75  30'
    'train_lego_60s       90  66'
    'render               20   4'
    'train_fox_12s        40  18'
    'train_scene_12s      40  18'
    'train_scene_4s       30   9'
    'train_scene_1.5s     30   6'
    'deterministic        45   8'
    'check_exchange       60  10'
    'check_fixed          60  10'
    'train_lego_12s_seed1 40  18'
    'train_lego_12s_seed2 40  18'
    'sweep_kept_16        25   9'
    'sweep_kept_18        25   9'
    'sweep_kept_19        25   9'
    'sweep_table_17       25   9'
    'sweep_table_21       25   9'
    'sweep_width_32       25   9'
    'kernels              90  10'
    'train_scene_60s      90  66'
)

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 2
}

# A whole number of seconds, at least 1.
whole() {
    [[ $2 =~ ^0*[1-9][0-9]{0,5}$ ]] || fail "$1 must be a whole number of seconds, found '$2'"
    printf '%s' $((10#$2))
}

script=$(readlink -f "${BASH_SOURCE[0]}")
if [ $# -lt 1 ]; then
    sed -n '7,16s/^# //p' "$script" >&2
    exit 2
fi
for tool in grep sed tar gzip timeout sha256sum stat; do
    command -v "$tool" >/dev/null || fail "there is no $tool, which this script needs"
done
here=$(dirname "$script")
bin=$here/bin
mkdir -p "$1" || exit 2
results=$(cd "$1" && pwd) || exit 2
: >"$results/.attempt" || fail "the folder $results cannot be written to"
rm -f "$results/.attempt"
most=$(whole SECONDS_ALL "${SECONDS_ALL:-540}") || exit 2
limit_all=$(whole LIMIT "${LIMIT:-3600}") || exit 2
# Of this call, if this is a part of one; else a new folder.
work=${NERF_WORK:-$(mktemp -d 2>/dev/null || printf '%s' "$results/.work")}
out=$work/results
export NERF_WORK=$work
mkdir -p "$out"
: >"$out/.attempt" || fail "the folder $out cannot be written to; say another in TMPDIR"
rm -f "$out/.attempt"
cd "$here" || exit 2
# Mesa's loader complains without it.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}
export RUST_BACKTRACE=0

# Sizes and times: those of a measurement, or those of a rehearsal.
if [ -z "${REHEARSAL:-}" ]; then
    views=60 size=800 percent=100 warm=10 measured=10 ceiling_seconds=0.3 steps=500
    batch=() photos=()
else
    views=20 size=100 percent=25 warm=1 measured=1 ceiling_seconds=0.02 steps=20
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

# Seconds with at most one decimal, scaled.
scaled() {
    local tenths=${1%.*}0
    [ "$1" = "${1%.*}" ] || tenths=$((tenths + ${1#*.}))
    printf '%d.%03d' $((tenths * percent / 1000)) $((tenths * percent % 1000))
}

part_adapters() {
    nerf adapters >"$out/adapters.json" || return
    {
        uname -srm
        sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo | head -n 1
        printf '%s cores\n' "$(nproc)"
        grep MemTotal /proc/meminfo
        if command -v nvidia-smi >/dev/null; then
            timeout -k 1 5 nvidia-smi --format=csv \
                --query-gpu=name,driver_version,memory.total,clocks.max.sm,clocks.max.mem || true
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
    "$bin/nerf" generate toys --out "$work/data/scene.part" --views "$views" --size "$size" --quiet \
        && mv "$work/data/scene.part" "$work/data/scene"
}

# The folder of a dataset.
dataset() {
    local folder
    for folder in "$work/data/$1" "$here/data/$1"_*; do
        if [ -d "$folder" ]; then
            printf '%s' "$folder"
            return
        fi
    done
    printf 'error: there is no dataset %s\n' "$1" >&2
    return 1
}

# The step benchmark; $1 names the result.
step() {
    local name=$1 folder ceilings=()
    shift
    # Where the scene was not generated, lego stands in.
    folder=$(dataset scene || dataset lego) || return
    [ ! -s "$out/ceilings.json" ] || ceilings=(--ceilings "$out/ceilings.json")
    on_adapter "$bin/step" --config gpu --dataset "$folder" ${batch[@]+"${batch[@]}"} "$@" \
        ${ceilings[@]+"${ceilings[@]}"} --out "$out/$name.json"
}

part_step() {
    step step --warm "$warm" --seconds "$measured" --rounds 1 --rounds 2 --rounds 4
}

# sweep_SETTING_VALUE
part_sweep() {
    local setting=${1#sweep_} value=${1##*_}
    setting=${setting%_*}
    case $setting in
    kept) set -- --set batch.kept=$((1 << value)) --set batch.samples=$((4 << value)) ;;
    table) set -- --set "grid.log2_table=$value" ;;
    width) set -- --set "network.width=$value" ;;
    esac
    step "sweep_${setting}_$value" "$@" --warm "$(scaled 3)" --seconds "$(scaled 3)" --no-start
}

# A training run and its score on all test views: the result's name, the dataset, and what else train takes.
train() {
    local name=$1 folder=$2 code=0
    shift 2
    nerf train "$folder" --out "$work/$name" --overwrite --eval-all "$@" >"$out/$name.json" || code=$?
    [ ! -e "$work/$name/log.jsonl" ] || cp "$work/$name/log.jsonl" "$out/$name.log.jsonl"
    [ "$code" -eq 0 ] || return "$code"
    if ! grep -q '"psnr":[0-9]' "$out/$name.json"; then
        printf 'error: the run has no PSNR: it diverged\n' >&2
        return 1
    fi
}

# train_DATASET_TIMEs, or train_DATASET_TIMEs_seedK
part_train() {
    local name=${1#train_} seed=0 folder
    [[ $name != *_seed* ]] || seed=${name##*_seed} name=${name%_seed*}
    folder=$(dataset "${name%_*}") || return
    name=${name##*_}
    train "$1" "$folder" ${photos[@]+"${photos[@]}"} --seconds "$(scaled "${name%s}")" --seed "$seed"
}

part_render() {
    local name
    for name in train_lego_60s train_lego_12s train_scene_12s; do
        if [ -e "$work/$name/checkpoint.safetensors" ]; then
            nerf render "$work/$name" --orbit 6 --width "$size" --height "$size" --out "$out/views" >"$out/render.json"
            return
        fi
    done
    printf 'error: no run to render\n' >&2
    return 1
}

part_deterministic() {
    local run folder sums
    folder=$(dataset scene || dataset lego) || return
    for run in deterministic_1 deterministic_2; do
        train "$run" "$folder" --deterministic --steps "$steps" || return
    done
    sums=$(sha256sum "$work"/deterministic_[12]/checkpoint.safetensors) || return
    sums=$(printf '%s\n' "$sums" | cut -d' ' -f1 | sort -u | wc -l)
    if [ "$sums" -eq 1 ]; then
        printf 'the same, bit for bit\n' >"$out/deterministic.txt"
    else
        printf 'different\n' >"$out/deterministic.txt"
        printf 'error: two deterministic runs differ\n' >&2
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
    printf '%s\n' "$*" >>"$out/summary.txt"
    printf '%s\n' "$*" >&2
}

# Puts all that is known into RESULTS; the archive is there whole at any time.
archive() {
    local new=$results/.results.$$
    if ! { tar -C "$out" -czf "$new" . && mv "$new" "$results/results.tar.gz" \
        && cp "$out/summary.txt" "$results/summary.txt"; }; then
        rm -f "$new"
        failed=yes
        printf 'error: %s cannot be written to\n' "$results" >&2
        return
    fi
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
    local library="LD_LIBRARY_PATH=$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" icds='' file found attempt
    for file in /usr/share/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json \
        /usr/local/nvidia/share/vulkan/icd.d/*.json /usr/local/nvidia/vulkan/icd.d/*.json /opt/*/share/vulkan/icd.d/*.json; do
        [ ! -e "$file" ] || icds=$icds${icds:+:}$file
    done
    local best=
    for attempt in 1 2 3; do
        local variables=()
        [ "$attempt" -lt 2 ] || variables+=("$library")
        [ "$attempt" -lt 3 ] || variables+=("VK_DRIVER_FILES=$icds")
        found=$(env ${variables[@]+"${variables[@]}"} timeout -k 1 10 "$bin/nerf" adapters --json 2>/dev/null </dev/null)
        if [[ $found =~ \"kind\":\"[A-Za-z]*Gpu\" ]] || { [ -z "$best" ] && [[ $found == *'"kind"'* ]]; }; then
            best=$attempt
            [[ ! $found =~ \"kind\":\"[A-Za-z]*Gpu\" ]] || break
        fi
        [ $((SECONDS - begin)) -lt $((most / 4)) ] || break
    done
    [ "${best:-1}" -lt 2 ] || export "${library?}"
    [ "${best:-1}" -lt 3 ] || export VK_DRIVER_FILES="$icds"
    case $best in
    1) say 'driver: found by the loader of this machine' ;;
    2) say 'driver: found by the loader of the bundle' ;;
    3) say "driver: found by the loader of the bundle among $icds" ;;
    *) say 'driver: none found' ;;
    esac
}

# Whether a result says that a kernel is wrong. A test that ends with an error, for want of an adapter say, does not.
is_wrong() {
    case $1 in
    check*) grep -q '"pass":false' "$out/$1.json" 2>/dev/null ;;
    kernels) grep -q '\.\.\. FAILED' "$out/kernels.txt" && grep -q 'panicked at' "$out/kernels.txt" ;;
    *) false ;;
    esac
}

# The figures of a part's result for the summary.
digest() {
    local key value line=''
    for key in psnr ssim steps; do
        value=$(grep -o "\"$key\":[0-9.]*" "$out/$1.json" 2>/dev/null | head -n 1)
        [ -z "$value" ] || line="$line${line:+, }$key $(printf '%.4g' "${value#*:}")"
    done
    printf '%s' "$line"
}

# Why a part did not end well, in one line: nerf tells it in JSON, others on stderr.
reason() {
    {
        grep -o '"error":.*' "$out/$1.json" | sed 's/^"error":"//; s/"}*$//; s/^error: //'
        grep -i error "$out/$1.err"
        tail -n 1 "$out/$1.err"
    } 2>/dev/null | sed 's/\\n.*//' | tr '\t' ' ' | cut -c 1-300 | grep -m 1 .
}

# Ends the part that runs, keeps what is known, and goes.
stopped() {
    [ -z "$child" ] || { kill -TERM "$child" && wait "$child"; } 2>/dev/null
    say 'stopped'
    archive
    rm -rf "$work"
    exit 2
}

begin=$SECONDS
wrong='' failed='' child=''
trap stopped INT TERM
{
    cat BUNDLE 2>/dev/null
    printf 'date %s\nrehearsal %s\nseconds %s\n' "$(date -u +%F)" "${REHEARSAL:-0}" "$most"
} >"$out/meta.txt"
printf '%s\n' "${parts[@]%% *}" >"$out/planned.txt"
: >"$out/summary.txt"
printf 'part\tstatus\tcode\tseconds\treason\n' >"$out/parts.tsv"
# Takes the place of what an earlier call left.
archive
find_driver
for part in "${parts[@]}"; do
    # shellcheck disable=SC2206
    words=($part)
    name=${words[0]} limit=${words[1]} least=$((words[2] * percent / 100))
    # The last seconds are for the archive.
    left=$((most - 5 - (SECONDS - begin)))
    limit=$((limit < limit_all ? limit : limit_all))
    why=''
    if [ "$left" -lt 1 ] || [ "$left" -lt "$least" ]; then
        status=skipped code=- took=0
    else
        start=$SECONDS
        NERF_PART=$name timeout -k 5 $((limit < left ? limit : left)) bash "$script" "$results" "$name" \
            </dev/null >"$out/$name.out" 2>"$out/$name.err" &
        child=$!
        wait "$child"
        code=$? child='' took=$((SECONDS - start))
        case $code in
        0) status='done' ;;
        124 | 137) status=timeout ;;
        *) status=failed ;;
        esac
        is_wrong "$name" && status=wrong
        [ "$status" = 'done' ] || why=$(reason "$name")
    fi
    case $status in
    'done') ;;
    wrong) wrong=yes ;;
    *) failed=yes ;;
    esac
    printf '%s\t%s\t%s\t%s\t%s\n' "$name" "$status" "$code" "$took" "$why" >>"$out/parts.tsv"
    say "$(printf '%4d s  %-21s %-8s %s' $((SECONDS - begin)) "$name" "$status" "$(digest "$name")")"
    [ -z "$why" ] || say "        $why"
    for file in "$out/$name.out" "$out/$name.err"; do
        if [ ! -s "$file" ]; then
            rm -f "$file"
        elif [ "$(stat -c %s "$file")" -gt $((1 << 18)) ]; then
            tail -c $((1 << 18)) "$file" >"$file.end" && mv "$file.end" "$file"
        fi
    done
    archive
done
[ "$(wc -l <"$out/parts.tsv")" -eq $((${#parts[@]} + 1)) ] || failed=yes
rm -rf "$work"
if [ -n "$wrong" ]; then
    printf 'error: kernels are wrong; see summary.txt\n' >&2
    exit 1
fi
[ -z "$failed" ] || exit 2
exit 0
