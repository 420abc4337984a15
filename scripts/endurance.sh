#!/usr/bin/env bash
# Shows that nothing is lost and nothing is left behind: kills at random moments and while saving, flipped bits, zeroed pages,
# a full disk, removed folders, several writers, and signals in every phase, on a small generated scene.
# usage: scripts/endurance.sh OUT
#   OUT       folder for endurance.md, a table
# environment:
#   KILLS FLIPS PAGES DAMAGED FULL REMOVALS WRITERS RENDERS SIGNALS
#             how often [default: 200 1000 100 10 5 10 10 5 45]
#   SEED      of what is random here [default: 1]
#   STEPS     of a training [default: 800]
#   NERF      binary to use instead of building it
# exit code: 1 if anything was not as it should be
set -euo pipefail
# Background processes in groups of their own, or bash would have them ignore SIGINT.
set -m

if [ $# -ne 1 ]; then
    sed -n '4,12s/^# //p' "$0" >&2
    exit 2
fi
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
nerf=${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
nerf=$(cd "$(dirname "$nerf")" && pwd)/$(basename "$nerf")
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
steps=${STEPS:-800}
RANDOM=${SEED:-1}
work=$(mktemp -d)
mounted=
trap '[ -z "$mounted" ] || umount "$mounted"; rm -rf "$work"' EXIT
failed=
checkpoint=checkpoint.safetensors

# A random number below $1, which $below is then.
random_below() {
    below=$(((RANDOM * 32768 + RANDOM) % $1))
}

pause() {
    sleep "$(printf '%d.%03d' $(($1 / 1000)) $(($1 % 1000)))"
}

now() {
    date +%s%3N
}

# Something was not as it should be.
wrong() {
    printf 'wrong: %s\n' "$*" >&2
    failed=yes
    return 1
}

# A row of the table: what, how often it was right, of how many, and what else there is to say.
row() {
    printf '| %s | %s of %s | %s |\n' "$1" "$2" "$3" "${4:-}" | tee -a "$out/endurance.md" >&2
    [ "$2" -eq "$3" ] || failed=yes
}

# The training that all others must end like; --no-eval and so on may follow the folder.
train() {
    local run=$1
    shift
    exec "$nerf" train "$work/toys" --out "$run" --config configs/smoke.json --deterministic --steps "$steps" \
        --checkpoint-every 0.3 --quiet "$@" >"$work/stdout" 2>"$work/stderr"
}

# Waits for a process; $code is its exit code.
await() {
    code=0
    wait "$1" 2>/dev/null || code=$?
}

# Waits until a row like this is in the log of a training, or that has ended.
await_row() {
    while kill -0 "$2" 2>/dev/null && ! grep -qs "$3" "$1/log.jsonl"; do
        sleep 0.02
    done
}

# Waits until a training has taken steps, or has ended.
await_steps() {
    await_row "$1" "$2" '"loss"'
}

# The steps of a checkpoint, by its header.
saved_step() {
    { head -c 16384 "$1" | grep -ao '\\"step\\":[0-9]*' | head -n 1 | tr -dc 0-9; } 2>/dev/null || true
}

# Whether a run is the one that was not disturbed, with all its rows and without leftovers.
is_whole() {
    cmp -s "$1/$checkpoint" "$work/whole/$checkpoint" || wrong "$1 ended with another checkpoint" || return
    local left last
    left=$(find "$1" -mindepth 1 ! -name 'checkpoint*.safetensors' ! -name config.json ! -name log.jsonl ! -name report.html)
    [ -z "$left" ] || wrong "left behind: $left" || return
    last=$(grep '"loss"' "$1/log.jsonl" | tail -n 1 | grep -o '"step":[0-9]*')
    [ "$last" = "\"step\":$steps" ] && [ -e "$1/config.json" ] || wrong "the log of $1 is not whole"
}

# Ends a run that was disturbed, and looks at it.
finish() {
    (train "$1" --no-eval --resume-or-start) || wrong "$1 cannot be resumed: $(cat "$work/stderr")" || return
    is_whole "$1"
}

prepare() {
    local begin
    "$nerf" generate toys --out "$work/toys" --views 11 --size 24 --quiet >/dev/null
    begin=$(now)
    (train "$work/whole")
    whole_ms=$(($(now) - begin))
    begin=$(now)
    (train "$work/whole" --no-eval --resume-or-start)
    start_ms=$(($(now) - begin))
    # A run that was stopped half way.
    (train "$work/half" --no-eval) &
    await_steps "$work/half" $!
    pause $(((whole_ms - start_ms) / 3))
    kill -TERM $!
    await $!
    [ "$code" -eq 143 ] || wrong "a training that was stopped ended with $code"
    printf 'a training takes %d ms, its start %d ms\n' "$whole_ms" "$start_ms" >&2
}

# Chains of kills, every other one while a checkpoint is written.
kills() {
    local count=$1 killed=0 saving=0 resumed=0 chains=0 equal=0 in_chain run=$work/chain expected pid begun
    while [ "$killed" -lt "$count" ]; do
        rm -rf "$run"
        in_chain=0 expected=
        while :; do
            (train "$run" --no-eval --resume-or-start) &
            pid=$!
            if [ "$in_chain" -lt 10 ] && [ "$killed" -lt "$count" ]; then
                if [ $((killed % 2)) -eq 0 ]; then
                    random_below $((2 * start_ms))
                    pause "$below"
                else
                    while kill -0 "$pid" 2>/dev/null && ! compgen -G "$run/.nerf-*.part" >/dev/null; do :; done
                fi
                kill -KILL "$pid" 2>/dev/null || true
            fi
            await "$pid"
            # The step that it began with must be that of the checkpoint; it may not have come so far.
            begun=$(grep -s '"event":"start"' "$run/log.jsonl" | tail -n 1 | grep -o '"step":[0-9]*' | tr -dc 0-9 || true)
            if [ "$code" -ne 0 ] && [ "$code" -ne 137 ]; then
                wrong "a killed training ended with $code when it was resumed: $(cat "$work/stderr")" || break
            elif [ -n "$expected" ]; then
                [ "${begun:-0}" -ge "$expected" ] || [ "$code" -eq 137 ] \
                    || wrong "saved at step $expected, and resumed from ${begun:-nothing}" || break
                resumed=$((resumed + 1))
            fi
            [ "$code" -eq 137 ] || break
            killed=$((killed + 1)) in_chain=$((in_chain + 1))
            compgen -G "$run/.nerf-*.part" >/dev/null && saving=$((saving + 1))
            expected=$(saved_step "$run/$checkpoint")
            expected=${expected:-0}
        done
        chains=$((chains + 1))
        is_whole "$run" && equal=$((equal + 1))
        [ "$chains" -le "$count" ] || break
    done
    row "SIGKILL at a random moment, resumed" "$resumed" "$killed" "$saving of them left half a checkpoint"
    row "chains of up to 10 kills, which end bit for bit like an undisturbed training without leftovers" "$equal" "$chains"
}

# The byte of $copy at $1 becomes $2.
put_byte() {
    printf "\\x$(printf %02x "$2")" | dd of="$copy" bs=1 seek="$1" conv=notrunc status=none
}

# Whether the checkpoint in $copy is refused as what it is: bad for good.
is_refused() {
    local answer=0
    "$nerf" render "$copy" --orbit 1 --width 8 --out "$work/none" --quiet >/dev/null 2>"$work/stderr" || answer=$?
    [ "$answer" -eq 1 ] || wrong "damage at $1 of $copy: exit code $answer"
}

flips() {
    local count=$1 pages=$2 right=0 size header at byte i
    copy=$work/copy.safetensors
    cp "$work/whole/$checkpoint" "$copy"
    size=$(stat -c %s "$copy")
    header=$(($(od -An -tu8 -N8 "$copy") + 8))
    for ((i = 0; i < count; i++)); do
        # Every fifth in the header.
        random_below $((i % 5 == 0 ? header : size))
        at=$below
        byte=$(od -An -tu1 -j "$at" -N1 "$copy")
        put_byte "$at" $((byte ^ (1 << (RANDOM % 8))))
        is_refused "$at" && right=$((right + 1))
        put_byte "$at" "$byte"
    done
    row "a flipped bit, every fifth in the header, refused" "$right" "$count"
    right=0
    for ((i = 0; i < pages; i++)); do
        cp "$work/whole/$checkpoint" "$copy"
        while cmp -s "$copy" "$work/whole/$checkpoint"; do
            random_below $((size / 4096))
            at=$below
            dd if=/dev/zero of="$copy" bs=4096 seek="$at" count=1 conv=notrunc status=none
        done
        is_refused "page $at" && right=$((right + 1))
    done
    row "a zeroed page, refused" "$right" "$pages"
    cp "$work/whole/$checkpoint" "$copy"
    "$nerf" render "$copy" --orbit 1 --width 8 --out "$work/undamaged" --quiet >/dev/null || wrong "$copy is not damaged"
}

# The newest checkpoint of a run is damaged: the one before is gone on with.
damaged() {
    local count=$1 right=0 run=$work/damaged i
    for ((i = 0; i < count; i++)); do
        rm -rf "$run"
        cp -r "$work/half" "$run"
        copy=$run/$checkpoint
        random_below "$(stat -c %s "$copy")"
        put_byte "$below" $(($(od -An -tu1 -j "$below" -N1 "$copy") ^ 64))
        finish "$run" && right=$((right + 1))
    done
    row "the newest checkpoint of a run damaged: ended from the one before, bit for bit" "$right" "$count"
}

# No room for checkpoints, as a limit on the size of files; and a disk that is full before.
full() {
    local count=$1 right=0 run=$work/full i
    for ((i = 0; i < count; i++)); do
        rm -rf "$run"
        cp -r "$work/half" "$run"
        code=0
        (trap '' XFSZ && ulimit -f 500 && train "$run" --no-eval --resume) || code=$?
        [ "$code" -eq 3 ] || wrong "without room the exit code is $code: $(cat "$work/stderr")" || continue
        cmp -s "$run/$checkpoint" "$work/half/$checkpoint" || wrong "a failed save changed the checkpoint" || continue
        finish "$run" && right=$((right + 1))
    done
    row "no room for a checkpoint: trained to the end, exit code 3, the one before kept; resumed" "$right" "$count"
    mkdir -p "$work/disk"
    if ! mount -t tmpfs -o size=1m tmpfs "$work/disk" 2>/dev/null; then
        printf '| a full disk, refused before training | left out | file systems cannot be mounted here |\n' >>"$out/endurance.md"
        return
    fi
    mounted=$work/disk
    code=0
    (train "$work/disk/run" --no-eval) || code=$?
    [ "$code" -eq 3 ] && [ -z "$(ls -A "$work/disk/run" 2>/dev/null)" ] && right=1 || right=0
    umount "$mounted"
    mounted=
    row "a full disk, refused before training with exit code 3" "$right" 1
}

# The folder of a run is removed or moved away in the middle.
removals() {
    local count=$1 right=0 run=$work/removed i pid
    for ((i = 0; i < count; i++)); do
        rm -rf "$run" "$run.away"
        (train "$run" --no-eval) &
        pid=$!
        await_steps "$run" "$pid"
        random_below $(((whole_ms - start_ms) / 2 + 1))
        pause "$below"
        if [ $((i % 2)) -eq 0 ]; then mv "$run" "$run.away"; else rm -rf "$run" 2>/dev/null || true; fi
        await "$pid"
        [ "$code" -eq 0 ] || wrong "without its folder the exit code is $code: $(cat "$work/stderr")" || continue
        is_whole "$run" && right=$((right + 1))
    done
    row "the folder of a run removed or moved away while it trains: made again, all rows and the checkpoint in it" "$right" "$count"
}

# Others try to train into the same folder.
writers() {
    local count=$1 right=0 run=$work/shared i pid how good
    for ((i = 0; i < count; i++)); do
        rm -rf "$run"
        (train "$run" --no-eval) &
        pid=$!
        await_steps "$run" "$pid"
        good=yes
        for how in --overwrite --resume-or-start --no-eval; do
            code=0
            "$nerf" train "$work/toys" --out "$run/../shared" "$how" --quiet >/dev/null 2>"$work/second" || code=$?
            [ "$code" -eq 3 ] && grep -q "process $pid " "$work/second" \
                || wrong "a second training with $how: $code, $(cat "$work/second")" || good=
        done
        await "$pid"
        [ "$code" -eq 0 ] && [ -n "$good" ] && is_whole "$run" && right=$((right + 1))
    done
    row "three more trainings into the folder of one that lives: refused with its process and exit code 3" "$right" "$count"
}

# Frames 0 to 23, by the range that follows the folder.
render() {
    exec "$nerf" render "$work/whole" --orbit 24 --width 48 --skip-existing --quiet --out "$1" --frames "$2" >/dev/null
}

# Several processes render one path; one of them is killed, and its part rendered again.
renders() {
    local count=$1 right=0 path=$work/path i pids part
    rm -rf "$work/frames"
    (render "$work/frames" 0..24)
    for ((i = 0; i < count; i++)); do
        rm -rf "$path"
        pids=()
        for part in 0..10 6..18 16..24; do
            (render "$path" "$part") &
            pids+=($!)
        done
        random_below $((2 * start_ms))
        pause "$below"
        kill -KILL "${pids[1]}" 2>/dev/null || true
        for part in "${pids[@]}"; do
            await "$part"
            [ "$code" -eq 0 ] || [ "$code" -eq 137 ] || wrong "rendering together ended with $code" || continue
        done
        (render "$path" 0..24) || wrong "the rest of a path was not rendered" || continue
        diff -r "$path" "$work/frames" >&2 || wrong "$path differs from one that one process rendered" || continue
        right=$((right + 1))
    done
    row "one path by three processes at the same time, one of them killed: the same pictures and listing, nothing else" "$right" "$count"
}

# Signals at random moments of whole trainings, the measuring at their end included.
signals() {
    local count=$1 right=0 longest=0 run=$work/signalled i pid name number begin took phase
    local -A phases=()
    for ((i = 0; i < count; i++)); do
        rm -rf "$run"
        case $((i % 3)) in
            0) name=INT number=130 ;;
            1) name=TERM number=143 ;;
            *) name=HUP number=129 ;;
        esac
        (train "$run" --eval-all) &
        pid=$!
        # Every fourth while it begins, every fourth when the last step is taken, the others at any time.
        if [ $((i % 4)) -eq 1 ]; then
            await_row "$run" "$pid" "\"step\":$steps,.*\"loss\""
        else
            random_below $((i % 4 == 0 ? start_ms : whole_ms))
            pause "$below"
        fi
        phase=loading
        ! grep -qs '"loss"' "$run/log.jsonl" || phase=training
        ! grep -qs "\"step\":$steps,.*\"loss\"" "$run/log.jsonl" || phase=ending
        begin=$(now)
        kill -"$name" "$pid" 2>/dev/null || true
        await "$pid"
        took=$(($(now) - begin))
        # It may have come when all was done.
        [ "$code" -ne 0 ] || phase=over
        [ "$code" -eq "$number" ] || [ "$phase" = over ] \
            || wrong "SIG$name while $phase ended with $code: $(cat "$work/stderr")" || continue
        phases[$phase]=$((${phases[$phase]:-0} + 1))
        [ "$took" -le "$longest" ] || longest=$took
        finish "$run" && right=$((right + 1))
    done
    row "SIGINT, SIGTERM or SIGHUP: its exit code; resumed, bit for bit" "$right" "$count" \
        "loading ${phases[loading]:-0}, training ${phases[training]:-0}, ending ${phases[ending]:-0}, too late ${phases[over]:-0}; ended within $longest ms"
}

begin=$(now)
prepare
printf '| what | as it should be | |\n| --- | ---: | --- |\n' >"$out/endurance.md"
kills "${KILLS:-200}"
flips "${FLIPS:-1000}" "${PAGES:-100}"
damaged "${DAMAGED:-10}"
full "${FULL:-5}"
removals "${REMOVALS:-10}"
writers "${WRITERS:-10}"
renders "${RENDERS:-5}"
signals "${SIGNALS:-45}"
printf '\n%s, %s, seed %s, %s steps a training, %d s in all\n' "$(date -u +%F)" \
    "$("$nerf" adapters 2>/dev/null | head -n 1 | tr -s ' ' | cut -d' ' -f2-)" "${SEED:-1}" "$steps" $((($(now) - begin) / 1000)) >>"$out/endurance.md"
[ -z "$failed" ]
