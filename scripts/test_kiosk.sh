#!/bin/sh
# Installs a kiosk in a container with systemd, kills its programs, and cuts its power again and again.
# Usage, as root: test_kiosk.sh [OPTION OF kiosk_container/drive.py ...]   ends as the test did; 4 if it cannot run
#   ENLIVEN_BARE  the folder of the container's root (out/bare), made once
#   KILLS         number of power cuts (20)
# The container has no network. The report and screenshots are in out/kiosk.
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap mke2fs e2fsprogs unshare util-linux nsenter util-linux
suite=trixie
packages=systemd-sysv,dbus,libpam-systemd,udev,kmod,procps,python3,python3-venv,cage,seatd,grim,xwayland
packages=$packages,libgl1,libegl1,libgles2,libgl1-mesa-dri,libglx-mesa0,libegl-mesa0,libxkbcommon0,libwayland-client0
packages=$packages,libwayland-cursor0,libwayland-egl1,libxcursor1,libxi6,libxrandr2,libxinerama1,fonts-dejavu-core
base=kiosk-$(printf %s "$suite,$packages" | cksum | cut -d ' ' -f 1) root=$roots/$base disk=$roots/kiosk-state.ext4

wheels() {
    # The lock's lines but for what is large and no program of the kiosk imports.
    .venv/bin/python scripts/lock.py lines dev x86_64 3.13 |
        grep -vE "^($(paste -sd '|' scripts/kiosk_container/without.txt))=="
}

in_root() {
    # Runs the commands of standard input in the root. Folder /mnt keeps pip's downloads.
    unshare --mount --pid --fork --kill-child sh -eu -c '
        mount -t proc proc "$1/proc"
        mount --bind "$2" "$1/mnt"
        exec env -i HOME=/root PIP_CACHE_DIR=/mnt PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$1" sh -eu
    ' sh "$root" "$roots/pip" >"$roots/kiosk-packages.log" 2>&1 ||
        fail "the root cannot be made: $(tail -n 1 "$roots/kiosk-packages.log") (all of it: $roots/kiosk-packages.log)"
}

make_root() {
    # The bare root with the wheels. It is made again if either changes.
    lines=$(wheels)
    stamp=$(printf '%s' "$lines $packages" | cat - scripts/kiosk_container/make-ready | cksum)
    [ "$(cat "$root.ready" 2>/dev/null)" = "$stamp" ] && return
    base_root "$base" --include="$packages" "$suite"
    fresh_root "$base"
    say "installing the packages of enliven into the root (two minutes, once)"
    mkdir -p "$roots/pip"
    printf '%s\n' "$lines" >"$root/opt/wheels.txt"
    in_root <scripts/kiosk_container/make-ready
    printf '%s' "$stamp" >"$root.ready"
}

copy_checkout() {
    # The checkout as it is, installed as `pip install -e` does.
    rm -rf "$root/opt/enliven"
    mkdir -p "$root/opt/enliven"
    git ls-files -coz --exclude-standard | tar --null --ignore-failed-read -T - -cf - 2>/dev/null |
        tar -C "$root/opt/enliven" -xf -
    echo 'cd /opt/enliven && /opt/venv/bin/pip install -q --no-deps --no-build-isolation --no-index \
        -e ./shared -e ./edge -e ./viewer -e ./synthesis' | in_root
}

make_root
copy_checkout
exec .venv/bin/python scripts/kiosk_container/drive.py --root "$root" --disk "$disk" --kills "${KILLS:-20}" "$@"
