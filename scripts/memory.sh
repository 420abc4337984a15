#!/usr/bin/env bash
# Compares the memory that training is stated to take, before a photo is loaded, with the most that the process then has in
# use, as Linux counts it: pages of shared libraries included, and the device's where the adapter is a CPU.
# usage: scripts/memory.sh DATASET … [-- FLAGS OF nerf train]
# environment:
#   NERF      binary to use instead of building it
#   TMPDIR    where runs go
# needs jq
set -euo pipefail

datasets=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do
    datasets+=("$(cd "$1" && pwd)")
    shift
done
shift || true
if [ ${#datasets[@]} -eq 0 ] || ! command -v jq >/dev/null; then
    sed -n '2,8s/^# //p' "$0" >&2
    exit 2
fi
cd "$(dirname "$0")/.."
nerf=${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

printf '| dataset | flags | stated: host, MiB | stated: device, MiB | together | measured | stated / measured |\n'
printf '| --- | --- | ---: | ---: | ---: | ---: | ---: |\n'
for dataset in "${datasets[@]}"; do
    "$nerf" train "$dataset" --out "$work/run" --overwrite --json --quiet --seconds 2 "$@" |
        jq -r --arg name "$(basename "$dataset")" --arg flags "$*" '
            def mib: . / 1048576 | round;
            .memory | (.host_bytes + .device_bytes) as $all
            | [$name, $flags, (.host_bytes | mib), (.device_bytes | mib), ($all | mib), (.peak_bytes | mib),
                ($all / .peak_bytes * 100 | round / 100)]
            | "| " + (map(tostring) | join(" | ")) + " |"'
done
