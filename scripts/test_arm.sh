#!/bin/sh
# Runs the numeric core's tests as an aarch64 processor would: Debian 12's Python and the locked aarch64 wheels
# under qemu-user. It emulates, so it is slow: one file after the other, each with a limit. Compiled
# kernels are kept, so that a second run takes a fraction of the first.
# Usage, as root: test_arm.sh [FILE ...]
#   ENLIVEN_BARE  the folder of the root (out/bare), made once;  LIMIT  seconds a file may take (900)
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap qemu-aarch64-static qemu-user-static dpkg-deb dpkg
root=$roots/arm packages=$roots/arm-packages

# The numeric core: codecs, rotations, deformation, surgery, and what of the tracker is arithmetic alone.
# ONNX Runtime's module crashes while it is imported under qemu-user 7.2, so nothing is here that needs the estimator.
core="shared/test_rotation shared/person/test_orientation shared/wire/test_quaternions_wire shared/wire/test_quantize
shared/recording/test_depth_codec shared/test_frames shared/wire/test_messages shared/test_masks shared/test_camera
shared/test_lanes shared/test_settings shared/samples/test_shapes shared/meshes/test_mesh shared/recording/test_recording
shared/deformation/test_skinning shared/deformation/test_block_cholesky shared/deformation/test_weights
shared/deformation/test_stiffness shared/deformation/test_sampling shared/deformation/test_graph
shared/deformation/test_attachment shared/deformation/test_spheres shared/deformation/test_soft_terms
shared/deformation/test_embedded shared/deformation/test_arap shared/matching/test_symmetry
shared/mapping/test_assignment shared/modeling/mesh/test_mesh_cut shared/modeling/mesh/test_mesh_planar
shared/formats/test_bvh shared/formats/test_expmap shared/formats/test_gltf_read edge/fusion/test_rigid
edge/tracking/scene/test_floor
edge/tracking/body_model/test_kinematics edge/tracking/body_model/test_ranges edge/stage/test_placing"

make_root() {
    # Unpacked and never entered: qemu-user gives the emulated Python this root for the system's files.
    [ -f "$root/ready" ] && return
    say "unpacking a Debian 12 for aarch64 (a minute or two, once)"
    rm -rf "$root"
    # shellcheck disable=SC2046
    debootstrap --variant=minbase --foreign --arch=arm64 --include=python3 bookworm "$root" $(mirror) \
        >"$root.log" 2>&1 || fail "debootstrap failed: $(tail -n 1 "$root.log") (all of it: $root.log)"
    for package in "$root"/var/cache/apt/archives/*.deb; do dpkg-deb -x "$package" "$root"; done
    touch "$root/ready"
}

install_wheels() {
    # The lock's lines for this machine, whichever machine pip itself runs on; hashes are checked as everywhere.
    lines=$(.venv/bin/python scripts/lock.py lines dev aarch64 3.11)
    [ "$(cat "$packages/ready" 2>/dev/null)" = "$lines" ] && return
    say "installing the locked aarch64 wheels"
    rm -rf "$packages"
    platforms=
    for glibc in 17 24 26 27 28 31 34; do platforms="$platforms --platform manylinux_2_${glibc}_aarch64"; done
    printf '%s\n' "$lines" >"$roots/arm.txt"
    # shellcheck disable=SC2086
    .venv/bin/python -m pip install -q --target "$packages" --platform manylinux2014_aarch64 $platforms \
        --python-version 3.11 --implementation cp --only-binary ':all:' --no-deps --no-compile --require-hashes \
        -r "$roots/arm.txt"
    printf '%s' "$lines" >"$packages/ready"
}

# shellcheck disable=SC2086
[ $# -gt 0 ] || set -- $(printf 'tests/%s.py ' $core)
make_root
install_wheels
mkdir -p "$roots/arm-tmp" "$roots/arm-numba"
green=0 red=
for file; do
    began=$(date +%s) code=0
    env PYTHONPATH="$packages:$PWD/shared:$PWD/edge:$PWD/synthesis" PYTHONPYCACHEPREFIX="$roots/arm-pyc" \
        PYTHONDONTWRITEBYTECODE= TMPDIR="$roots/arm-tmp" \
        NUMBA_CACHE_DIR="$roots/arm-numba" OPENBLAS_NUM_THREADS=1 timeout -k 10 "${LIMIT:-900}" \
        qemu-aarch64-static -L "$root" "$root/usr/bin/python3.11" -m pytest -p no:xdist "$file" \
        >"$roots/arm-last.log" 2>&1 </dev/null || code=$?
    if [ "$code" = 0 ]; then
        green=$((green + 1))
    else
        red="$red $file" && tail -n 30 "$roots/arm-last.log"
    fi
    say "$file: $(tail -n 1 "$roots/arm-last.log"); exit $code after $(($(date +%s) - began)) s"
done
say "aarch64 under qemu-user: $green of $# files passed${red:+; not these:$red}"
[ -z "$red" ]
