#!/usr/bin/env bash
# Everything that a change must pass: format, lints, documentation, and all tests, a short training with a
# bound on its PSNR among them. clippy and rustdoc share the metadata of the dependencies, so they come first.
set -euo pipefail
cd "$(dirname "$0")/.."

step() {
    printf '== %s\n' "$*"
    "$@"
}

step scripts/setup.sh
step cargo fmt --check
step cargo clippy --all-targets --locked -- -D warnings
step env RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --locked
step cargo test --locked
