#!/usr/bin/env bash
# Packs everything that scripts/gpu.sh needs into one archive, for a machine with a GPU driver and nothing else: the
# programs without their debug information, the kernel tests with the data they read, the Vulkan loader and what drivers
# may want of X11 beside it, and small datasets. Writes nerf-gpu.tar.gz and RUN.md; fails above 60 MiB.
# usage: scripts/bundle.sh OUT
# environment:
#   DATA      folder that holds the datasets [default: ../shared/data]
#   DATASETS  their names [default: lego_200 fox_270x480]; may be empty: gpu.sh measures on those that there are
set -euo pipefail

most_mib=60
# Unpacked, not installed: a bare machine may lack them. NVIDIA's driver finds no device without libEGL and libGL.
packages=(libvulkan1 libegl1 libgl1 libglx0 libglvnd0 libgles2 libopengl0
    libx11-6 libxext6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0)

if [ $# -ne 1 ]; then
    sed -n '5,8s/^# //p' "$0" >&2
    exit 2
fi
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
datasets=${DATASETS-lego_200 fox_270x480}
data=${DATA:-../shared/data}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
bundle=$work/nerf-gpu
mkdir -p "$bundle/bin" "$bundle/lib" "$bundle/data"

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

scripts/setup.sh
printf 'building\n' >&2
cargo build --release --locked --bin nerf --bench ceilings --bench step --test kernels \
    --message-format json-render-diagnostics >"$work/built"
for program in nerf ceilings step kernels; do
    path=$(sed -n "s/.*\"name\":\"$program\".*\"executable\":\"\([^\"]*\)\".*/\1/p" "$work/built" | tail -n 1)
    [ -n "$path" ] || fail "cargo does not say where $program lies"
    cp "$path" "$bundle/bin/$program"
    strip "$bundle/bin/$program"
done

if command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null; then
    (cd "$work" && apt-get -o APT::Sandbox::User=root download -qq "${packages[@]}") >&2
    for package in "$work"/*.deb; do
        dpkg-deb -x "$package" "$work/packages"
    done
    find "$work/packages" -name 'lib*.so*' -exec cp -P {} "$bundle/lib/" \;
    [ -e "$bundle/lib/libvulkan.so.1" ] || fail "the package ${packages[0]} has no libvulkan.so.1"
else
    printf 'warning: without apt-get the bundle has no Vulkan loader\n' >&2
fi

# The tests read vectors from below where they run.
mkdir -p "$bundle/tests"
cp -r tests/vectors "$bundle/tests/"
cp scripts/gpu.sh "$bundle/"
for dataset in $datasets; do
    [ -d "$data/$dataset" ] || fail "there is no $data/$dataset; say where in DATA, or which in DATASETS"
    cp -rL "$data/$dataset" "$bundle/data/$dataset"
done
commit=$(git rev-parse --short HEAD 2>/dev/null || echo unknown)
[ -z "$(git status --porcelain 2>/dev/null)" ] || commit="$commit with changes"
glibc=$(objdump -T "$bundle/bin/nerf" 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1 | cut -d_ -f2)
printf 'commit %s\nbuilt_for %s\nglibc %s\ndatasets %s\n' "$commit" "$(uname -m)" "${glibc:-unknown}" "$datasets" >"$bundle/BUNDLE"

tar -C "$work" -czf "$out/nerf-gpu.tar.gz" nerf-gpu
cat >"$out/RUN.md" <<END
# One command on a GPU machine

Needs a GPU's driver, bash, coreutils, tar and gzip; for $(uname -s) on $(uname -m) with glibc ${glibc:-unknown} or newer. No
network, no root. Takes 9 minutes at most:

\`\`\`sh
tar xzf nerf-gpu.tar.gz && nerf-gpu/gpu.sh RESULTS
\`\`\`

Bring back the folder RESULTS: \`results.tar.gz\`, which is renewed after every part, and \`summary.txt\`. The exit code is 1
if a kernel is wrong, 2 if a part failed or did not run, else 0. Where they came from,
\`scripts/gpu_results.py RESULTS/results.tar.gz\` turns them into a page and the README's table.
END
bytes=$(du -sb "$out/nerf-gpu.tar.gz" "$out/RUN.md" | awk '{ sum += $1 } END { print sum }')
awk -v bytes="$bytes" -v out="$out" 'BEGIN { printf "%s: %.1f MiB\n", out, bytes / 1048576 }'
[ "$bytes" -le $((most_mib << 20)) ] || fail "that is more than $most_mib MiB"
