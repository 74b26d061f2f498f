# SPDX-License-Identifier: Apache-2.0
# For bash scripts that need a Debian 12 with nothing in it (debootstrap, chroot; root): sourced by test-packages and
# test-bare-machine, which define die(). The minimal system is made once and kept in $roots/base.tar (200 MB).
roots=${SONOCASE_ROOTS:-${XDG_CACHE_HOME:-$HOME/.cache}/sonocase/roots}
mirror=${SONOCASE_DEBIAN_MIRROR:-http://deb.debian.org/debian}

fresh_system() { # fresh_system ROOT: a minimal Debian 12 in the folder ROOT, in place of what was there
    local root=$1
    command -v debootstrap >/dev/null || die "debootstrap is missing; run scripts/install-packages packaging"
    mkdir -p "$roots"
    if [[ ! -e $roots/base.tar ]]; then
        rm -rf "$roots/base"
        debootstrap --variant=minbase bookworm "$roots/base" "$mirror" >"$roots/debootstrap.log" 2>&1 ||
            die "debootstrap cannot make a clean Debian 12 from $mirror (see $roots/debootstrap.log): is the mirror reached, and may this user make device files?"
        tar -C "$roots/base" -cf "$roots/base.tar.part" . && mv "$roots/base.tar.part" "$roots/base.tar"
        rm -rf "$roots/base"
    fi
    rm -rf "$root"
    mkdir -p "$root"
    tar -C "$root" -xf "$roots/base.tar"
    inside "$root" true || die "chroot cannot run a program in $root: is chroot allowed here?"
}

inside() { # inside ROOT COMMAND...
    local root=$1
    shift
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
        ${DISPLAY:+"DISPLAY=$DISPLAY"} "$@"
}
