# shellcheck shell=sh
# Roots of Debian and Ubuntu for the tests that need another machine than this one; read with `.` by test_bare.sh and test_arm.sh.
roots=${ENLIVEN_BARE:-$PWD/out/bare}
mkdir -p "$roots"
roots=$(cd "$roots" && pwd)

say() { printf '%s\n' "enliven: $*"; }
fail() { printf '%s\n' "enliven: $*" >&2; exit 4; }

needs() {
    # needs TOOL PACKAGE ...: ends with a sentence where a tool is missing.
    while [ $# -gt 0 ]; do
        command -v "$1" >/dev/null 2>&1 || fail "$1 is missing. Type: sudo apt-get install $2"
        shift 2
    done
    [ "$(id -u)" = 0 ] || fail "a Debian root can only be made by root. Type: sudo -E make ..."
}

mirror() {
    # The archive that this machine's own apt uses for Debian; nothing where this is no Debian (debootstrap knows one).
    # shellcheck disable=SC2016
    apt-get indextargets --format '$(ORIGIN) $(SITE)' 'Created-By: Packages' 2>/dev/null |
        sed -n 's/^Debian //p' | grep -v security | head -n 1
}

is_ubuntu() {
    # is_ubuntu SUITE: true for the long-term releases of Ubuntu with Python 3.11 or newer.
    case $1 in noble | resolute) true ;; *) false ;; esac
}

has_ubuntu_keys() { [ -f /usr/share/keyrings/ubuntu-archive-keyring.gpg ]; }

ubuntu_scripts() {
    # ubuntu_scripts SUITE: a copy of debootstrap's scripts that knows the suite; an older debootstrap may not.
    rm -rf "$roots/debootstrap"
    cp -r "${DEBOOTSTRAP_DIR:-/usr/share/debootstrap}" "$roots/debootstrap"
    [ -e "$roots/debootstrap/scripts/$1" ] || ln -s gutsy "$roots/debootstrap/scripts/$1"
    printf '%s' "$roots/debootstrap"
}

base_root() {
    # base_root NAME OPTIONS... SUITE: makes NAME.tar by debootstrap, once; half of one is never kept.
    name=$1
    shift
    [ -f "$roots/$name.tar" ] && return
    say "making a bare root for $name by debootstrap (some minutes, once)"
    rm -rf "${roots:?}/$name"
    for suite_of_root; do :; done
    if is_ubuntu "$suite_of_root"; then
        # Python's venv is in the component universe. debootstrap itself knows an archive of Ubuntu.
        unchecked=${UNCHECKED:+--no-check-gpg}
        [ "$unchecked" ] || has_ubuntu_keys ||
            fail "the keys of Ubuntu's archive are missing. Type: sudo apt-get install ubuntu-archive-keyring" \
                "(or, to trust the network, set UNCHECKED=1)"
        scripts=$(ubuntu_scripts "$suite_of_root")
        # shellcheck disable=SC2086
        DEBOOTSTRAP_DIR=$scripts debootstrap --variant=minbase --components=main,universe $unchecked "$@" "$roots/$name"
    else
        # shellcheck disable=SC2046
        debootstrap --variant=minbase "$@" "$roots/$name" $(mirror)
    fi >"$roots/$name.log" 2>&1 ||
        fail "debootstrap failed: $(tail -n 1 "$roots/$name.log") (all of it: $roots/$name.log)"
    rm -rf "$roots/$name/var/cache/apt/archives/"*.deb
    tar -C "$roots/$name" -cf "$roots/$name.part" . && mv "$roots/$name.part" "$roots/$name.tar"
}

fresh_root() {
    # fresh_root NAME: unpacks NAME.tar as it was made, and lets it see the network as this machine does.
    rm -rf "${roots:?}/$1"
    mkdir "$roots/$1"
    tar -C "$roots/$1" -xf "$roots/$1.tar"
    cp /etc/resolv.conf /etc/hosts "$roots/$1/etc/"
    for file in /etc/pip.conf "$HOME/.config/pip/pip.conf" "$HOME/.pip/pip.conf"; do
        [ -f "$file" ] || continue
        copy=$roots/$1/root${file#"$HOME"}
        [ "$file" = /etc/pip.conf ] && copy=$roots/$1/etc/pip.conf
        mkdir -p "${copy%/*}" && cp "$file" "$copy"
    done
    certificates=${PIP_CERT:-${SSL_CERT_FILE:-}}
    if [ -f "$certificates" ]; then
        mkdir -p "$roots/$1${certificates%/*}" && cp "$certificates" "$roots/$1$certificates"
    fi
    if [ -d "${PIP_FIND_LINKS:-}" ]; then
        mkdir -p "$roots/$1$PIP_FIND_LINKS" && cp -r "$PIP_FIND_LINKS/." "$roots/$1$PIP_FIND_LINKS"
    fi
    export -p | grep -iE '^(export|declare -x) (PIP_[A-Z_]*|(http|https|no)_proxy)=' >"$roots/$1/opt/network.sh" || true
}
