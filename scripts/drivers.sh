#!/usr/bin/env bash
# Runs nerf check on every path, and a short training run, on several Vulkan drivers that need no GPU: the machine's own,
# SwiftShader, and the lavapipe of another Debian release. Drivers that compile and schedule differently find what one
# alone forgives; SwiftShader has few bindings, no float atomics and small subgroups, as modest GPUs do.
# usage: scripts/drivers.sh OUT [DRIVER…]
#   OUT     folder for DRIVER.txt, all that was printed, and drivers.md, the table
#   DRIVER  system, swiftshader (from the package chromium-common), or a Debian release whose lavapipe is installed into a
#           folder below target/, which takes root and debootstrap [default: system swiftshader sid]
# environment:
#   NERF    binary to use instead of building it
set -euo pipefail

if [ $# -lt 1 ]; then
    sed -n '5,10s/^# //p' "$0" >&2
    exit 2
fi
mkdir -p "$1"
out=$(cd "$1" && pwd)
shift
cd "$(dirname "$0")/.."
drivers=("$@")
[ ${#drivers[@]} -gt 0 ] || drivers=(system swiftshader sid)
cache=${CARGO_TARGET_DIR:-target}/drivers
mkdir -p "$cache"
cache=$(cd "$cache" && pwd)
if [ -z "${NERF:-}" ]; then
    scripts/setup.sh
    cargo build --release --locked
fi
nerf=$(realpath "${NERF:-${CARGO_TARGET_DIR:-target}/release/nerf}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=

# Names of the paths, and what they ask of nerf check.
paths='
own
ordered      --accumulation ordered
fixed        --accumulation fixed
long         --accumulation long
float        --accumulation float
exchange     --accumulation exchange
buffers      --memory buffers
buffers_gpu  --memory buffers --product tiled --accumulation exchange
textures     --memory textures
one_row      --product 1
four_rows    --product 4
shared       --product shared
'

# The adapter of a driver: sets `run`, what comes before a command.
prepare() {
    case $1 in
    system) run=(env XDG_RUNTIME_DIR="$work") ;;
    swiftshader)
        local icd
        icd=$(find "$cache/swiftshader" -name 'vk_swiftshader_icd.json' 2>/dev/null | head -n 1)
        if [ -z "$icd" ]; then
            (cd "$work" && apt-get -o APT::Sandbox::User=root download -qq chromium-common) || return
            dpkg-deb -x "$work"/chromium-common*.deb "$cache/swiftshader" || return
            icd=$(find "$cache/swiftshader" -name 'vk_swiftshader_icd.json' | head -n 1)
        fi
        [ -n "$icd" ] || return
        run=(env XDG_RUNTIME_DIR="$work" VK_DRIVER_FILES="$icd")
        ;;
    *)
        local root=$cache/$1 mirror
        if [ ! -e "$root/ready" ]; then
            command -v chroot >/dev/null || return
            command -v debootstrap >/dev/null || apt-get install -y -qq debootstrap || return
            # Where this machine's own packages come from.
            # shellcheck disable=SC2016
            mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -v security | head -n 1)
            rm -rf "$root"
            debootstrap --variant=minbase --include=libvulkan1,mesa-vulkan-drivers "$1" "$root" "$mirror" || return
            touch "$root/ready"
        fi
        mkdir -p "$root/nerf"
        cp "$nerf" "$root/nerf/nerf"
        rm -rf "$root/nerf/toys" "$root/nerf/smoke.json"
        cp -r "$work/toys" configs/smoke.json "$root/nerf/"
        run=(chroot "$root" env XDG_RUNTIME_DIR=/tmp)
        ;;
    esac
}

# Files as the driver's programs see them.
seen() {
    case $1 in
    system | swiftshader) nerf_seen=$nerf toys=$work/toys run_folder=$work/run smoke=configs/smoke.json ;;
    *) nerf_seen=/nerf/nerf toys=/nerf/toys run_folder=/nerf/run smoke=/nerf/smoke.json ;;
    esac
}

# One path of one driver: prints a word for the table.
check() {
    local text code=0
    text=$("${run[@]}" "$nerf_seen" check --quiet "${@:2}" 2>&1) || code=$?
    printf '== check %s\n%s\n' "${*:2}" "$text" >>"$out/$1.txt"
    if [ $code -eq 0 ]; then
        printf 'pass'
    elif [ $# -gt 1 ] && grep -q 'does not have it; \|does not have them; \|those of the adapter' <<<"$text"; then
        printf 'not there'
    else
        printf 'FAIL'
    fi
}

# A short training run: its PSNR.
train() {
    local text code=0
    text=$("${run[@]}" "$nerf_seen" train "$toys" --out "$run_folder" --config "$smoke" --steps 400 --overwrite \
        --eval-all --quiet --json "${@:2}" 2>&1) || code=$?
    printf '== train %s\n%s\n' "${*:2}" "$text" >>"$out/$1.txt"
    if [ $code -eq 0 ]; then
        # It reaches 25 dB; what learns nothing has 10.
        sed -n 's/.*"psnr":\([0-9.]*\).*/\1/p' <<<"$text" \
            | awk '$1 > 23 { printf "%.2f dB", $1; fine = 1 } END { if (!fine) printf "FAIL" }'
    else
        printf 'FAIL'
    fi
}

"$nerf" generate toys --out "$work/toys" --views 40 --size 60 --quiet >/dev/null
{
    printf '| driver |'
    awk 'NF { printf " %s |", $1 }' <<<"$paths"
    printf ' training | with distortion and sparsity |\n| --- |'
    awk 'NF { printf " --- |" }' <<<"$paths"
    printf ' ---: | ---: |\n'
} >"$out/drivers.md"
for driver in "${drivers[@]}"; do
    printf '%s\n' "$driver" >&2
    : >"$out/$driver.txt"
    if ! prepare "$driver" >>"$out/$driver.txt" 2>&1; then
        printf '| %s | cannot be had here |\n' "$driver" >>"$out/drivers.md"
        printf '    cannot be had here; see %s\n' "$out/$driver.txt" >&2
        failed=yes
        continue
    fi
    seen "$driver"
    row="| $("${run[@]}" "$nerf_seen" adapters 2>/dev/null | sed -n '1s/^0  *//p' | tr -s ' ') |"
    while read -r name arguments; do
        [ -n "$name" ] || continue
        # shellcheck disable=SC2086
        word=$(check "$driver" $arguments)
        printf '    %-12s %s\n' "$name" "$word" >&2
        row="$row $word |"
    done <<<"$paths"
    plain=$(train "$driver")
    further=$(train "$driver" --set loss.distortion=0.005 --set loss.sparsity=0.0001)
    printf '    %-12s %s, with distortion and sparsity %s\n' training "$plain" "$further" >&2
    row="$row $plain | $further |"
    printf '%s\n' "$row" >>"$out/drivers.md"
    case $row in *FAIL*) failed=yes ;; esac
done
cat "$out/drivers.md"
[ -z "$failed" ]
