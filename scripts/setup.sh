#!/bin/sh
# Makes this checkout ready: a Python, the packages in .venv, and the few system libraries that are missing.
# Usage: setup.sh run | dev | devices.  Asks nothing, says what it is about to do, and is done at once the second time.
set -eu
cd "$(dirname "$0")/.."
kind=${1:-run} devices=
[ "$kind" = devices ] && kind=dev devices=yes

say() { printf '%s\n' "enliven: $*"; }
fail() { printf '%s\n' "enliven: $*" >&2; exit 4; }

find_python() {
    # The wheels of moderngl for Linux on aarch64 end with Python 3.11.
    newest=14 known="python3.13 python3.12 python3.11"
    [ "$(uname -sm)" = "Linux aarch64" ] && newest=11 known=python3.11
    for name in ${PYTHON:-} $known python3 python; do
        if command -v "$name" >/dev/null 2>&1 &&
            "$name" -c "import sys; sys.exit(not ((3, 11) <= sys.version_info[:2] <= (3, $newest)))" 2>/dev/null; then
            printf '%s' "$name"
            return
        fi
    done
}

make_venv() {
    [ -x .venv/bin/python ] && .venv/bin/python -c 'import sys, pip' 2>/dev/null && return
    python=$(find_python)
    [ -n "$python" ] || fail "no Python 3.11 or newer was found. Install one (Debian: apt install python3 python3-venv," \
        "macOS: brew install python@3.12), or name one: make run PYTHON=/path/to/python3"
    say "making .venv with $("$python" --version)"
    rm -rf .venv
    if ! "$python" -m venv .venv; then
        rm -rf .venv
        install_system python3-venv || fail "this Python cannot make a virtual environment: apt install python3-venv"
        "$python" -m venv .venv
    fi
}

install_python() {
    # Every wheel is checked against its hash in locks/; pip's own first, because an old pip takes twice as long for
    # the others. The four packages have no hash, being folders: pip takes them in a step of their own, which asks
    # no index. Byte code is made last, by all cores and not one, and not of what is hardly ever imported.
    export PIP_DISABLE_PIP_VERSION_CHECK=1
    awk '/^[^ #]/ { of_pip = /^pip==/ } of_pip' "locks/$kind.txt" >.venv/pip.txt
    for lock in .venv/pip.txt "locks/$kind.txt"; do
        .venv/bin/python -m pip install -q --require-hashes --no-deps --no-compile --only-binary ':all:' -r "$lock" ||
            fail "the packages could not be installed; what pip said is above. Is there a network?"
    done
    .venv/bin/python -m pip install -q --no-deps --no-build-isolation --no-index -e ./shared -e ./edge -e ./viewer -e ./synthesis
    .venv/bin/python -m compileall -qq -j 0 -x '/(tests?|pip|setuptools|pygments)/' .venv/lib || true
}

install_system() {
    if ! command -v apt-get >/dev/null 2>&1; then
        return 1
    elif [ "$(id -u)" = 0 ]; then
        sudo=
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
        sudo="sudo -n"
    else
        return 1
    fi
    say "installing system packages with apt: $*"
    $sudo apt-get update -qq >/dev/null && DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq "$@" >/dev/null
}

missing_system() {
    [ "$(uname -s)" = Linux ] || return 0
    .venv/bin/python - "$kind" <<'PY'
import ctypes, shutil, sys
def lacks(name):
    try:
        ctypes.CDLL(name)
        return False
    except OSError:
        return True
wanted = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"}
print(*[package for library, package in wanted.items() if lacks(library)], end=" ")
if sys.argv[1] == "dev":
    print(*[package for tool, package in {"Xvfb": "xvfb", "xvfb-run": "xvfb", "ps": "procps"}.items() if not shutil.which(tool)], end="")
PY
}

spoken_tests() {
    # Tests speak to the voice commands with these; without them they are skipped, and nothing else is lost.
    command -v espeak-ng >/dev/null 2>&1 || printf 'espeak-ng '
    .venv/bin/python -c 'import ctypes; ctypes.CDLL("libportaudio.so.2")' 2>/dev/null || printf 'libportaudio2'
}

device_tests() {
    # The panel's firmware is compiled by the one and run by the other; without them make test skips its tests.
    [ -e /usr/lib/avr/include/avr/io.h ] && command -v avr-gcc >/dev/null 2>&1 || printf 'gcc-avr avr-libc '
    [ -e /usr/include/simavr/sim_avr.h ] || printf 'libsimavr-dev '
    command -v cc >/dev/null 2>&1 || printf 'gcc libc6-dev '
    # And the guest of scripts/test_guest.sh.
    command -v qemu-system-x86_64 >/dev/null 2>&1 || printf 'qemu-system-x86 '
    command -v debootstrap >/dev/null 2>&1 || printf 'debootstrap'
}

stamp=".venv/.ready-$kind"
wanted=$(cat VERSION "locks/$kind.txt" shared/pyproject.toml edge/pyproject.toml viewer/pyproject.toml synthesis/pyproject.toml scripts/setup.sh | cksum)
make_venv
if [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ]; then
    missing=$(missing_system | tr -s ' \n' '\n' | sort -u | tr '\n' ' ')
    if [ -n "$(printf '%s' "$missing" | tr -d ' ')" ]; then
        # shellcheck disable=SC2086
        install_system $missing || fail "these system packages are missing: $missing" \
            "Type: sudo apt-get install -y $missing"
    fi
    say "installing the Python packages into .venv (a minute or two, once)"
    install_python
    [ "$kind" = dev ] && [ "$(uname -s)" = Linux ] && more=$(spoken_tests) || more=
    # shellcheck disable=SC2086
    [ -z "$more" ] || install_system $more || say "without $more the tests of voice commands are skipped"
    printf '%s' "$wanted" >"$stamp"
fi
if [ "$devices" ]; then
    missing=$(device_tests)
    # shellcheck disable=SC2086
    [ -z "$missing" ] || install_system $missing || fail "these system packages are missing: $missing" \
        "Type: sudo apt-get install -y $missing"
fi
# The checkout's own byte code too: where Python is told to write none (PYTHONDONTWRITEBYTECODE, in many images),
# every start would compile 400 files. 0.1 s where nothing has changed.
.venv/bin/python -m compileall -q shared/enliven edge/enliven_edge viewer/enliven_viewer synthesis/enliven_synthesis || true
