#!/bin/sh
# Runs `make run` and `make test` on the last commit in bare systems, where there is Python and nothing else.
# Usage, as root: test_bare.sh [SUITE ...]     bookworm is Debian 12 with Python 3.11, trixie is Debian 13 with 3.13,
#   noble is Ubuntu 24.04 LTS with Python 3.12; without a suite: these three, the last if its archive's keys are here
#   UNCHECKED     not empty: trust the network for Ubuntu, without the keys of its archive
#   ENLIVEN_BARE  the folder of the roots (out/bare); they are made once, and unpacked afresh for every run
#   STEPS         what make is asked for in turn ("run test");  ARGS  what `make test` hands to pytest
#   PATIENCE      seconds after which a step is ended (3600)
# Mounts and processes live in namespaces of their own, so none outlives this script, however it ends.
set -eu
cd "$(dirname "$0")/.."
. scripts/debian_root.sh
needs debootstrap debootstrap unshare util-linux git git

step() {
    # step SUITE NAME: one `make NAME` in the root; its exit code and seconds are said, its output is kept and shown.
    root=$roots/$1 log=$roots/$1-$2.log more=
    [ "$2" = test ] && more=${ARGS:-}
    began=$(date +%s) code=0
    unshare --mount --pid --fork --kill-child sh -eu -c '
        root=$1 cache=$2 data=$3
        mount -t proc proc "$root/proc"
        mount -t sysfs -o ro sysfs "$root/sys"
        mount -t tmpfs tmpfs "$root/dev/shm"
        mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts"
        mount --bind "$cache" "$root/opt/pip"
        [ -z "$data" ] || mount --bind -o ro "$data" "$root/opt/house/shared"
        exec env -i HOME=/root PIP_CACHE_DIR=/opt/pip PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin ARGS="$5" \
            timeout -k 10 "$6" chroot "$root" sh -c ". /opt/network.sh; cd /opt/house/enliven && exec make $4"
    ' sh "$root" "$roots/pip" "$data" "$2" "$more" "${PATIENCE:-3600}" </dev/null >"$log" 2>&1 || code=$?
    tail -n 25 "$log"
    result="$1, $3: make $2${more:+ ARGS=\"$more\"}: exit $code after $(($(date +%s) - began)) s (all of it: $log)"
    say "$result"
    results="$results
$result"
    [ "$code" = 0 ] || red=1
}

[ $# -gt 0 ] || set -- bookworm trixie $(has_ubuntu_keys && echo noble)
[ -z "$(git status --porcelain)" ] || say "what is not committed is not tried"
data=$(cd ../shared 2>/dev/null && [ -d data ] && pwd) || data=
mkdir -p "$roots/pip"
results= red=0
for suite; do
    base_root "$suite" --include=python3,python3-venv,make,git "$suite"
    fresh_root "$suite"
    root=$roots/$suite
    mkdir -p "$root/opt/pip" "$root/opt/house/shared"
    printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d" && chmod +x "$root/usr/sbin/policy-rc.d"
    git clone -q --no-hardlinks . "$root/opt/house/enliven"
    python=$(chroot "$root" python3 --version)
    for name in ${STEPS:-run test}; do step "$suite" "$name" "$python"; done
done
say "in bare roots:$results"
exit "$red"
