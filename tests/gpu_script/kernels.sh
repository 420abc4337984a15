#!/usr/bin/env bash
# Stands in for the kernel tests in the tests of scripts/gpu.sh. WRONG=kernels lets one fail,
# BROKEN=kernels lets it end with an error.
if [ "${WRONG:-}" = kernels ]; then
    printf 'test grid::one_feature_by_hand ... FAILED\n'
    printf 'thread panicked at tests/kernels/grid.rs:1:1:\ntest result: FAILED. 36 passed; 1 failed; 0 ignored\n'
    exit 101
fi
if [ "${BROKEN:-}" = kernels ]; then
    printf 'test grid::one_feature_by_hand ... FAILED\nError: no adapter\ntest result: FAILED. 36 passed; 1 failed\n'
    exit 101
fi
printf 'test result: ok. 37 passed; 0 failed; 0 ignored\n'
