#!/usr/bin/env bash
# Everything that a change must pass: format, lints, documentation, and all tests, a short training run with a
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
# The device, the field and its checkpoints, as a viewer takes them; then with everything but the program.
step cargo clippy --no-default-features --lib --locked -- -D warnings
step cargo clippy --no-default-features --features run --lib --locked -- -D warnings
step env RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --locked
step cargo test --locked
