#!/usr/bin/env bash
# Stands in for nerf in the tests of scripts/gpu.sh: answers at once, in the same words. WRONG names a path whose kernels
# are wrong, BROKEN a path or a training run that ends with an error.
out=
for ((i = 1; i <= $#; i++)); do
    next=$((i + 1))
    case ${!i} in
    --out) out=${!next} ;;
    --accumulation) path=${!next} ;;
    esac
done
case $1 in
adapters)
    # With NEEDS_LIBRARY it finds nothing but with the bundle's own loader.
    if [ -n "${NEEDS_LIBRARY:-}" ] && [[ ${LD_LIBRARY_PATH:-} != *bundle/lib* ]]; then
        printf '{"error":"error: no adapter"}\n'
        exit 1
    fi
    printf '%s\n' '{"adapters":[{"index":0,"name":"Test GPU (rev 2)","kind":"DiscreteGpu","backend":"Vulkan","driver":"test 1.0","max_binding_bytes":1024,"features":["timestamps"],"subgroup_sizes":[32,32],"cooperative_matrices":[{"m":16,"n":16,"k":16,"factors":"F16","sums":"F32"}],"limits":{}}]}'
    ;;
check)
    if [ "${BROKEN:-}" = "${path:-own}" ]; then
        printf '{"error":"error: the device was lost"}\n'
        exit 1
    fi
    if [ "${WRONG:-}" = "${path:-own}" ]; then
        printf '{"pass":false,"kernels":[{"name":"hash grid: features","pass":false}],"rays":[]}\n'
        exit 1
    fi
    printf '{"pass":true,"kernels":[{"name":"hash grid: features","pass":true}],"rays":[]}\n'
    ;;
generate) mkdir -p "$out" ;;
train)
    if [ "${BROKEN:-}" = "${out##*/}" ]; then
        printf '{"error":"error: the device was lost\\n\\n  tip: none"}\n'
        exit 1
    fi
    mkdir -p "$out"
    printf 'weights\n' >"$out/checkpoint.safetensors"
    printf '{"step":16}\n' >"$out/log.jsonl"
    if [ "${DIVERGED:-}" = "${out##*/}" ]; then
        printf '{"steps":100,"seconds":12.01,"psnr":null,"ssim":null,"views":25,"skipped":100}\n'
        exit
    fi
    printf '{"steps":100,"seconds":12.01,"psnr":34.567,"ssim":0.9876,"views":25,"skipped":0}\n'
    ;;
render)
    mkdir -p "$out"
    printf 'pixels\n' >"$out/0000.png"
    printf '{"out":"views","frames":3,"seconds":[0.9,0.02,0.03,0.04]}\n'
    ;;
esac
