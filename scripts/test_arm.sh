#!/bin/sh
# Runs the numeric core's tests as an aarch64 processor would: Debian 12's Python and the locked aarch64 wheels
# under qemu-user. It emulates, so it is slow: one file after the other, each with a limit. Compiled
# kernels are kept, so that a second run takes a fraction of the first.
# Usage, as root: test_arm.sh [FILE ...]
#              or test_arm.sh release    runs the edge of a release with its compiled kernels
#   ENLIVEN_BARE  the folder of the root (out/bare), made once;  LIMIT  seconds a file (900) or the edge (1800) may take
#   ARCHIVES      the folder of the release's wheels (out/release/archives)
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap dpkg-deb dpkg
root=$roots/arm packages=$roots/arm-packages

# The numeric core: codecs, rotations, deformation, surgery, and what of the tracker is arithmetic alone.
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

unpack_root() {
    # unpack_root NAME ARCHITECTURE SUITE PACKAGE: a root of Debian with a package. It is unpacked and never entered:
    # qemu-user gives the emulated Python this root for the system's files.
    [ -f "$roots/$1/ready" ] && return
    say "unpacking a Debian ($3, $2) with $4 (a minute or two, once)"
    rm -rf "${roots:?}/$1"
    # shellcheck disable=SC2046
    debootstrap --variant=minbase --foreign --arch="$2" --include="$4" "$3" "$roots/$1" $(mirror) \
        >"$roots/$1.log" 2>&1 || fail "debootstrap failed: $(tail -n 1 "$roots/$1.log") (all of it: $roots/$1.log)"
    for package in "$roots/$1"/var/cache/apt/archives/*.deb; do dpkg-deb -x "$package" "$roots/$1"; done
    touch "$roots/$1/ready"
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

install_release() {
    # As pip does it on a Raspberry Pi: it finds the wheel of kernels for aarch64 among those for other processors.
    rm -rf "$1"
    version=$(cat VERSION)
    .venv/bin/python -m pip install -q --target "$1" --platform manylinux_2_28_aarch64 --python-version 3.11 \
        --implementation cp --only-binary ':all:' --no-deps --no-compile --no-index \
        --find-links "${ARCHIVES:-out/release/archives}" \
        "enliven==$version" "enliven-edge==$version" "enliven-kernels==$version" ||
        fail "there are no wheels of enliven $version in ${ARCHIVES:-out/release/archives}. Type: make release"
}

emulate() {
    # emulate PATH WORD ...: runs Python with the words, and with the modules in the path and in the locked wheels.
    path=$1
    shift
    env PYTHONPATH="$path:$packages" PYTHONPYCACHEPREFIX="$roots/arm-pyc" \
        PYTHONDONTWRITEBYTECODE= HOME="$roots/arm-tmp" TMPDIR="$roots/arm-tmp" NUMBA_CACHE_DIR="${kernels:-$roots/arm-numba}" \
        OPENBLAS_NUM_THREADS=1 timeout -k 10 "${LIMIT:-900}" \
        "$roots/qemu/usr/bin/qemu-aarch64" -L "$root" "$root/usr/bin/python3.11" "$@" \
        >"$roots/arm-last.log" 2>&1 </dev/null
}

try_release() {
    # The edge of the release: it must compile nothing, and its poses must match those of the system test.
    kernels=$roots/arm-tmp/kernels take=$roots/arm-tmp/take.mcap began=$(date +%s) LIMIT=${LIMIT:-1800}
    install_release "$roots/arm-release"
    rm -rf "$kernels" "$take"
    (
        cd "$roots/arm-tmp" # away from the checkout, so that only the wheels are used
        emulate "$roots/arm-release" -m enliven edge --possess-at 1.5 --seconds 3 --speed 0 --port 0 \
            --control-port 0 --name whole --record "$take"
    ) || fail "the edge failed: $(tail -n 5 "$roots/arm-last.log")"
    say "the edge of the release ran in $(($(date +%s) - began)) s: $(tail -n 1 "$roots/arm-last.log")"
    compiled=$(find "$kernels" -name '*.kernel' 2>/dev/null | wc -l)
    say "$(find "$roots/arm-release" -name '*.kernel' | wc -l) kernels shipped, $compiled compiled"
    [ "$compiled" = 0 ] || fail "the edge compiled kernels that the release should contain: see $kernels"
    .venv/bin/python -c "
import sys
sys.path += ['tests/system', 'tests/helpers']
import numpy as np
import test_road
test_road.as_stored(test_road.fields_of('$take'), dict(np.load(test_road.POSES)))
" || fail "the poses of $take differ from those of tests/system/references"
    say "the poses match tests/system/references"
}

unpack_root arm arm64 bookworm python3
# ONNX Runtime crashes under the qemu-user 7.2 of Debian 12, but not under the version 10 of Debian 13.
unpack_root qemu "$(dpkg --print-architecture)" trixie qemu-user
install_wheels
mkdir -p "$roots/arm-tmp" "$roots/arm-numba"
if [ "${1:-}" = release ]; then
    try_release
    exit
fi
# shellcheck disable=SC2086
[ $# -gt 0 ] || set -- $(printf 'tests/%s.py ' $core)
green=0 red=
for file; do
    began=$(date +%s) code=0
    emulate "$PWD/shared:$PWD/edge:$PWD/synthesis" -m pytest -p no:xdist "$file" || code=$?
    if [ "$code" = 0 ]; then
        green=$((green + 1))
    else
        red="$red $file" && tail -n 30 "$roots/arm-last.log"
    fi
    say "$file: $(tail -n 1 "$roots/arm-last.log"); exit $code after $(($(date +%s) - began)) s"
done
say "aarch64 under qemu-user: $green of $# files passed${red:+; not these:$red}"
[ -z "$red" ]
