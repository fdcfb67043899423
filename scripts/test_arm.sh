#!/bin/sh
# Runs the numeric core's tests as an aarch64 processor would: Debian 12's Python and the locked aarch64 wheels
# under qemu-user. It emulates, so it is slow: one file after the other, each with a limit, worst case stated last.
# Usage, as root: test_arm.sh [FILE ...]
#   ENLIVEN_BARE  the folder of the root (out/bare), made once;  LIMIT  seconds a file may take (900)
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap qemu-aarch64-static qemu-user-static dpkg-deb dpkg
root=$roots/arm packages=$roots/arm-packages

core="rotation orientation quaternions_wire quantize depth_codec frames messages masks camera lanes settings shapes
mesh recording deformation/skinning deformation/block_cholesky deformation/weights deformation/stiffness
deformation/sampling deformation/graph deformation/attachment deformation/spheres deformation/soft_terms
deformation/embedded deformation/arap matching/symmetry mapping/assignment modeling/mesh_cut modeling/mesh_planar
formats/bvh formats/expmap formats/gltf_read"
edge="test_placing fusion/test_rigid tracking/test_gravity tracking/test_floor tracking/test_kinematics
tracking/test_ranges tracking/test_room tracking/test_segmentation tracking/test_belonging tracking/test_evidence
tracking/test_appearance"

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

[ $# -gt 0 ] || set -- $(for name in $core; do echo "tests/shared/${name%/*}/test_${name##*/}.py"; done |
    sed 's|tests/shared/\([a-z_]*\)/test_\1.py|tests/shared/test_\1.py|') \
    $(for name in $edge; do echo "tests/edge/$name.py"; done)
make_root
install_wheels
mkdir -p "$roots/arm-tmp" "$roots/arm-numba"
green=0 red=
for file; do
    began=$(date +%s) code=0
    last=$(env PYTHONPATH="$packages:$PWD/shared:$PWD/edge" PYTHONDONTWRITEBYTECODE= TMPDIR="$roots/arm-tmp" \
        PYTHONPYCACHEPREFIX="$roots/arm-pyc" NUMBA_CACHE_DIR="$roots/arm-numba" OPENBLAS_NUM_THREADS=1 \
        timeout -k 10 "${LIMIT:-900}" qemu-aarch64-static -L "$root" "$root/usr/bin/python3.11" \
        -m pytest -p no:xdist "$file" 2>&1 </dev/null | tee "$roots/arm-last.log" | tail -n 1) || code=$?
    grep -E '^(FAILED|ERROR|E  )' "$roots/arm-last.log" || true
    say "$file: ${last:-ended without a word} ($(($(date +%s) - began)) s)"
    case $last in
        *failed* | *error* | '') red="$red $file" ;;
        *passed*) green=$((green + 1)) ;;
        *) red="$red $file" ;;
    esac
done
say "aarch64 under qemu-user: $green of $# files passed${red:+; not these:$red}"
[ -z "$red" ]
