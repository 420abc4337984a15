#!/usr/bin/env bash
# Makes sure that nerf can be built, run and tested here: a Rust toolchain, a C compiler to link with, a Vulkan driver, and
# Python for the scripts that tests run. Says what it installs; says nothing where nothing is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# Installs Debian packages, as root or through sudo. $1 says what for.
install() {
    local reason=$1 root=()
    shift
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail "$reason is missing; as root, run: apt-get install $*"
        root=(sudo)
    fi
    printf '%s is missing: installing %s with apt-get\n' "$reason" "$*" >&2
    "${root[@]}" apt-get update -qq >&2
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >&2
}

is_debian() {
    [ -e /etc/debian_version ] && command -v apt-get >/dev/null
}

has_vulkan() {
    local loader driver
    loader=$( (ldconfig -p 2>/dev/null || /sbin/ldconfig -p 2>/dev/null || true) | grep -c 'libvulkan\.so\.1 ' || true)
    driver=$(find "${XDG_DATA_HOME:-$HOME/.local/share}/vulkan/icd.d" /usr/share/vulkan/icd.d \
        /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d -name '*.json' 2>/dev/null | head -n 1 || true)
    [ "$loader" -gt 0 ] && [ -n "${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-$driver}}" ]
}

if ! command -v cargo >/dev/null; then
    fail "cargo was not found: install Rust $(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml) or newer" \
        "from https://rustup.rs, open a new shell, and run this again"
fi
if ! command -v cc >/dev/null; then
    is_debian || fail "no C compiler (cc) was found, and Rust links with it: install gcc or clang"
    install "a C compiler" gcc libc6-dev
fi
if ! command -v python3 >/dev/null; then
    is_debian || fail "no python3 was found: install Python 3.8 or newer"
    install "Python" python3
fi
# macOS has Metal and Windows has DX12.
if [ "$(uname -s)" = Linux ] && ! has_vulkan; then
    is_debian || fail "no Vulkan driver was found: install the Vulkan loader and either the driver of your GPU or" \
        "Mesa's software driver (Fedora: vulkan-loader mesa-vulkan-drivers; Arch: vulkan-icd-loader vulkan-swrast)"
    install "a Vulkan driver" libvulkan1 mesa-vulkan-drivers
fi
