#!/usr/bin/env bash
# From nothing to pictures: builds nerf, generates a scene, trains on it, measures the result and renders it.
# usage: scripts/demo.sh [--overwrite] [--seconds S] [OUT]
set -euo pipefail

fail() {
    printf 'error: %s\n' "$1" >&2
    exit "${2:-1}"
}

stop() {
    [ -n "$running" ] || exit "$2"
    kill "-$1" "$running" 2>/dev/null || true
}

# Runs a command, to which signals to this script go on, and ends as it does where it fails.
run() {
    local code=0
    "$@" &
    running=$!
    wait "$running" || code=$?
    # A signal ends the wait, not the command.
    while kill -0 "$running" 2>/dev/null; do
        code=0
        wait "$running" || code=$?
    done
    running=
    [ "$code" -eq 0 ] || exit "$code"
}

out=demo
seconds=60
overwrite=
while [ $# -gt 0 ]; do
    case $1 in
        --overwrite) overwrite=yes ;;
        --seconds)
            [ $# -gt 1 ] || fail "--seconds needs a number" 2
            seconds=$2
            shift
            ;;
        -*) fail "usage: scripts/demo.sh [--overwrite] [--seconds S] [OUT]" 2 ;;
        *) out=$1 ;;
    esac
    shift
done

# Only folders that this script made are ever replaced.
mark=$out/.nerf-demo
if [ -e "$mark" ]; then
    [ -n "$overwrite" ] || fail "there is a demo in $out already; add --overwrite, or name another folder"
elif [ -e "$out" ] && [ -n "$(ls -A "$out")" ]; then
    fail "$out is not empty and was not made by this script; name another folder"
fi
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/setup.sh
cargo build --release --locked
touch "$out/.nerf-demo"
rm -rf "$out/dataset" "$out/run" "$out/views"
nerf=${CARGO_TARGET_DIR:-target}/release/nerf

running=
trap 'stop INT 130' INT
trap 'stop TERM 143' TERM
trap 'stop HUP 129' HUP
run "$nerf" generate toys --out "$out/dataset"
run "$nerf" train "$out/dataset" --out "$out/run" --seconds "$seconds"
run "$nerf" render "$out/run" --out "$out/views" --orbit 24 --format png --format exr

cat <<END

dataset    $out/dataset
training   $out/run (checkpoint.safetensors, config.json, log.jsonl)
report     $out/run/report.html (open it in a browser: curves, test views, times)
pictures   $out/views (0000.png, 0000.exr, …: 24 cameras around the scene)
END
