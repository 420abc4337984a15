#!/usr/bin/env bash
# Measures what is published about datasets: what nerf info makes of each file of a folder, and how fast photos are
# loaded in how much memory.
# usage: scripts/datasets.sh CORPUS OUT [COUNTxWIDTHxHEIGHT …]
#   CORPUS    folder of transforms.json files of any names; their images may be missing
#   OUT       folder for corpus.md and loading.md
#   COUNT…    photos to load [default: those of benches/loading.rs]
# environment:
#   NERF      binary to use instead of building it
#   TMPDIR    where the photos go, up to a gigabyte
# needs jq
set -euo pipefail

if [ $# -lt 2 ] || [ ! -d "$1" ] || ! command -v jq >/dev/null; then
    sed -n '4,11s/^# //p' "$0" >&2
    exit 2
fi
corpus=$(cd "$1" && pwd)
mkdir -p "$2"
out=$(cd "$2" && pwd)
shift 2
cd "$(dirname "$0")/.."
nerf=${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}

{
    printf '| file | dialect | frames | cameras | lenses | assumed, repaired, or looks wrong (apart from the missing images) |\n'
    printf '| --- | --- | ---: | ---: | --- | --- |\n'
    for file in "$corpus"/*.json; do
        # A dataset without images is one that training would fail on.
        { "$nerf" info "$file" --json --quiet 2>/dev/null || true; } | jq -r --arg file "$(basename "$file" .json)" '
            [.problems[] | select(.message | test("listed images is there|Vulkan, Metal or DX12|is held out for testing") | not)
                | .severity + ": " + (.message | gsub("\\|"; "/"))] as $remarks
            | [$file, .dialect, .frames, .cameras, ([.optics.lenses[]?.model] | join(", ")), ($remarks | join("<br>"))]
            | "| " + (map(tostring) | join(" | ")) + " |"'
    done
} >"$out/corpus.md"
cargo bench --quiet --locked --bench loading -- "$@" >"$out/loading.md"
