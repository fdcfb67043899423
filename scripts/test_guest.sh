#!/bin/sh
# Boots a Debian 13 with its own kernel in QEMU, and runs tests/devices/guest in it: real HID, USB, cameras and udev.
# Usage, as root: test_guest.sh [PYTEST ARGUMENT ...]      ends as the tests in the guest did; 4 where it cannot run
#   ENLIVEN_BARE  the folder of the guest's disk (out/bare), made once;  PATIENCE  seconds the guest may take (1800)
#   ACCEL         what QEMU computes with (tcg, which every machine has; kvm is faster where it works)
# The guest has no network and writes to a copy of its disk that goes with it. Its log is out/devices/guest.log.
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap qemu-system-x86_64 qemu-system-x86 mke2fs e2fsprogs unshare util-linux
suite=trixie disk=$roots/guest.ext4 logs=out/devices
packages=linux-image-amd64,initramfs-tools,systemd-sysv,dbus,libpam-systemd,login,udev,kmod,acl
packages=$packages,python3,python3-venv,python3-libcamera,libcamera-ipa
base=guest-$(printf %s "$suite,$packages" | cksum | cut -d ' ' -f 1) root=$roots/$base

wheels() {
    # The lock's lines but for what is large and no test of the guest imports.
    .venv/bin/python scripts/lock.py lines dev x86_64 3.13 | grep -vE "^($(paste -sd '|' scripts/guest/without.txt))=="
}

in_root() {
    # in_root FOLDER: runs the commands of standard input in the root, which sees the checkout, and FOLDER as /mnt.
    unshare --mount --pid --fork --kill-child sh -eu -c '
        mount -t proc proc "$1/proc"
        mount --bind "$2" "$1/mnt"
        mount --bind -o ro . "$1/opt/enliven"
        exec env -i HOME=/root PIP_CACHE_DIR=/mnt PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$1" sh -eu
    ' sh "$root" "$1" >"$roots/guest-packages.log" 2>&1
}

make_vimc() {
    # Debian's kernel has no vimc, the camera that libcamera drives: its module is built from Debian's own sources.
    [ -f "$roots/$base-vimc/vimc.ko" ] && return
    say "building the kernel's virtual camera vimc (a minute or two, once)"
    fresh_root "$base"
    mkdir -p "$root/opt/enliven" "$roots/$base-vimc"
    in_root "$roots/$base-vimc" <scripts/guest/build-vimc ||
        say "vimc cannot be built: $(tail -n 1 "$roots/guest-packages.log"); what needs it is skipped"
}

make_disk() {
    # A disk of the bare root, the wheels, three users and the service that runs the tests; made again when any changes.
    lines=$(wheels)
    stamp=$(printf '%s' "$lines $packages" | cat - scripts/guest/* edge/pyproject.toml | cksum)
    [ "$(cat "$disk.ready" 2>/dev/null)" = "$stamp" ] && return
    base_root "$base" --include="$packages" "$suite"
    make_vimc
    fresh_root "$base"
    say "making the guest's disk (two minutes, once)"
    mkdir -p "$root/opt/enliven" "$roots/pip"
    printf '%s\n' "$lines" >"$root/opt/wheels.txt"
    cp scripts/guest/*.service "$root/etc/systemd/system/"
    cp scripts/guest/run-tests "$root/usr/local/sbin/" && chmod 755 "$root/usr/local/sbin/run-tests"
    in_root "$roots/pip" <scripts/guest/make-ready ||
        fail "the guest cannot be made: $(tail -n 1 "$roots/guest-packages.log") (all of it: $roots/guest-packages.log)"
    [ ! -f "$roots/$base-vimc/vimc.ko" ] || cp "$roots/$base-vimc/vimc.ko" "$root/opt/"
    cp "$root/vmlinuz" "$roots/guest.kernel"
    cp "$root/initrd.img" "$roots/guest.initrd"
    rm -f "$disk"
    mke2fs -q -t ext4 -O ^has_journal -E root_owner=0:0 -d "$root" "$disk" 4G
    rm -rf "$root"
    printf '%s' "$stamp" >"$disk.ready"
}

boot() {
    # The checkout goes in as a tar file on a disk of its own; what the tests say comes out by the second serial port.
    git ls-files -coz --exclude-standard | tar --null --ignore-failed-read -T - -cf "$work/checkout.tar" 2>/dev/null
    printf '%s\n' "$@" >"$work/arguments" && tar -C "$work" -rf "$work/checkout.tar" arguments
    truncate -s %512 "$work/checkout.tar"
    timeout -k 5 "${PATIENCE:-1800}" qemu-system-x86_64 -machine q35 -accel "${ACCEL:-tcg}" -cpu Nehalem -smp 2 -m 2048 \
        -nodefaults -no-reboot -display none -vga std -kernel "$roots/guest.kernel" -initrd "$roots/guest.initrd" \
        -append "root=/dev/vda rw console=ttyS0 panic=-1 systemd.show_status=0 quiet" \
        -drive "if=virtio,format=raw,snapshot=on,file=$disk" \
        -drive "if=virtio,format=raw,readonly=on,file=$work/checkout.tar" \
        -serial "file:$logs/guest-console.log" -serial "file:$logs/guest.log" </dev/null &
    wait $!
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'kill $! 2>/dev/null; exit 130' INT TERM
mkdir -p "$logs"
rm -f "$logs"/guest*.log
make_disk
began=$(date +%s) code=0
boot "$@" || code=$?
[ -s "$logs/guest.log" ] && cat "$logs/guest.log"
said=$(tr -d '\r' <"$logs/guest.log" 2>/dev/null | sed -n 's/^the guest ends with //p' | tail -n 1)
if [ -z "$said" ]; then
    tail -n 20 "$logs/guest-console.log" 2>/dev/null || true
    [ "$code" != 124 ] || say "the guest was ended after ${PATIENCE:-1800} s"
    fail "the guest did not come to its end (QEMU: $code); its console: $logs/guest-console.log"
fi
say "in the guest: exit $said after $(($(date +%s) - began)) s; $logs/guest.log"
exit "$said"
