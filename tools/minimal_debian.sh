#!/usr/bin/env bash
# Makes a minimal Debian system with git, make and Python, clones this repository's last commit into it, and runs the
# README's two commands there, or the words that follow: `tools/minimal_debian.sh make run ARGS=--exit`. Needs root and
# debootstrap. SUITE names another release than trixie, FOLDER a folder that is kept and used again. The mirror, proxies
# and certificates are those that this machine is set up with.
set -euo pipefail
cd "$(dirname "$0")/.."

suite=${SUITE:-trixie}
if [ "$(id -u)" -ne 0 ]; then
    echo "A system is made and entered by root alone: run this with sudo." >&2
    exit 1
fi
for tool in debootstrap unshare git; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: apt-get install debootstrap util-linux git." >&2; exit 1; }
done
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' 'Component: main' |
    grep -v security | head -n 1 || true)
if [ -z "$mirror" ]; then
    echo "apt is not set up for Debian's packages here: run this on a Debian." >&2
    exit 1
fi

if [ -n "${FOLDER:-}" ]; then
    root=$(realpath -m "$FOLDER")
else
    root=$(mktemp -d "${TMPDIR:-/tmp}/rayfarm-debian-XXXXXX")
    trap 'rm -rf --one-file-system "$root" "$root.lock"' EXIT
fi

# Whatever a run leaves behind holds its lock, too: two would take the checkout from under each other.
exec 9>"$root.lock"
flock -n 9 || { echo "Another run is in $root: wait for its end, or name another FOLDER." >&2; exit 1; }

# Nothing of this machine's environment holds in there, as TMPDIR, whose folder is not there.
clean="env -i HOME=/root LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"

if [ ! -e "$root/.made" ]; then
    # An https mirror is trusted by this machine's certificates, which the new system gets below.
    debootstrap --variant=minbase --include=git,make,python3,ca-certificates "$suite" "$root" "$mirror" >"$root.log" 2>&1 ||
        { tail -n 20 "$root.log" >&2; exit 1; }
    apt-config dump Acquire >"$root/etc/apt/apt.conf.d/90this-machine"
    cp -L /etc/resolv.conf "$root/etc/resolv.conf"
    [ ! -e /etc/pip.conf ] || cp /etc/pip.conf "$root/etc/pip.conf"
    find /usr/local/share/ca-certificates -name '*.crt' -exec cp {} "$root/usr/local/share/ca-certificates/" \;
    chroot "$root" $clean update-ca-certificates >"$root.log" 2>&1 || { cat "$root.log" >&2; exit 1; }
    rm "$root.log"
    touch "$root/.made"
fi

rm -rf "$root/opt/rayfarm"
git bundle create -q "$root/opt/rayfarm.bundle" HEAD
chroot "$root" $clean git -c init.defaultBranch=main -c advice.detachedHead=false clone -q /opt/rayfarm.bundle /opt/rayfarm

# Mounts and processes end with the namespaces, however this ends. The folder becomes the root as a disk of its own
# would be, not by chroot: in there namespaces can be made again, which tests do.
enter='
mount --make-rprivate /
mount --bind "$root" "$root"
cd "$root"
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys
mount --rbind /dev dev
mount -t tmpfs tmpfs dev/shm
mount -t tmpfs -o mode=1777 tmpfs tmp
pivot_root . mnt
cd /
umount -l /mnt
exec $clean bash -euc "cd /opt/rayfarm && \"\$@\"" minimal "$@"
'
run() { root=$root clean=$clean unshare --mount --pid --fork --kill-child bash -euc "$enter" minimal "$@"; }

if [ $# -gt 0 ]; then
    run "$@"
else
    run make run ARGS=--exit
    run make test
fi
