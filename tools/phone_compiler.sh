#!/usr/bin/env bash
# Builds Mesa's compilers for Adreno (ir3) and Mali (panfrost) with their no-op DRM shims, for `rayfarm compile`, from
# Debian's source package. They go to $RAYFARM_PHONE_COMPILER, else to the user's cache folder for rayfarm. About 16
# CPU minutes. Nothing else needs them, and nothing outside that folder is changed but packages that are missing.
set -euo pipefail
cd "$(dirname "$0")/.."

MESA=25.0.7
SHA256=592272df3cf01e85e7db300c449df5061092574d099da275d19e97ef0510f8a6
SUITES=(bookworm-backports trixie)

python=${PYTHON:-python3}
cache=${RAYFARM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/rayfarm}
target=$(realpath -m "${RAYFARM_PHONE_COMPILER:-$cache/phone-compiler}")
if [ "$(cat "$target/version" 2>/dev/null)" = "$MESA" ]; then
    echo "Mesa $MESA's compilers are in $target already."
    exit 0
fi

tools/system_packages.sh phone-compiler
work=$(mktemp -d "${TMPDIR:-/tmp}/rayfarm-phone-compiler-XXXXXX")
trap 'rm -rf "$work"' EXIT

# apt with lists of its own: the system's sources, which may name no source packages, stay as they are.
origin=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' 'Component: main' |
    grep -v security | head -n 1 || true)
if [ -z "$origin" ]; then
    echo "apt is not set up for Debian's packages here: run this where it is, and copy the folder that it makes." >&2
    exit 1
fi
mkdir -p "$work/lists/partial" "$work/source"
own_apt=(-o "Dir::Etc::sourcelist=$work/sources.list" -o Dir::Etc::sourceparts=/dev/null
    -o "Dir::State::lists=$work/lists" -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User=)
fetch() {
    local signed=/usr/share/keyrings/debian-archive-keyring.gpg version
    echo "deb-src [signed-by=$signed] $origin $1 main" >"$work/sources.list"
    apt-get "${own_apt[@]}" update -qq || return 1
    version=$(apt-cache "${own_apt[@]}" showsrc --only-source mesa | sed -n "s/^Version: \($MESA-.*\)/\1/p" | head -n 1)
    [ -n "$version" ] || return 1
    (cd "$work/source" && apt-get "${own_apt[@]}" source -qq --only-source --download-only --tar-only "mesa=$version")
}
for suite in "${SUITES[@]}"; do
    if fetch "$suite"; then break; fi
done
tarball="$work/source/mesa_$MESA.orig.tar.xz"
if [ ! -f "$tarball" ]; then
    echo "Debian's source package of Mesa $MESA is in none of ${SUITES[*]} as apt sees them here." >&2
    exit 1
fi
echo "$SHA256  $tarball" | sha256sum --check --quiet

"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip --disable-pip-version-check -q install -c constraints.txt meson mako pyyaml packaging setuptools
PATH="$work/venv/bin:$PATH"

tar -xJf "$tarball" -C "$work/source" --strip-components=1
meson setup "$work/build" "$work/source" --prefix "$work/installed" --libdir lib --buildtype release --wrap-mode nodownload \
    -D gallium-drivers=freedreno,panfrost -D vulkan-drivers= -D platforms= -D tools=drm-shim \
    -D egl=enabled -D gles1=disabled -D gles2=enabled -D shared-glapi=enabled -D opengl=true \
    -D glx=disabled -D gbm=disabled -D llvm=disabled -D glvnd=disabled -D shader-cache=disabled \
    -D video-codecs= -D gallium-va=disabled -D gallium-vdpau=disabled -D zstd=disabled -D xmlconfig=disabled \
    -D libunwind=disabled -D valgrind=disabled -D lmsensors=disabled -D build-tests=false >"$work/setup.log" 2>&1 ||
    { tail -n 20 "$work/setup.log" >&2; exit 1; }
ninja -C "$work/build" install >"$work/build.log" 2>&1 || { tail -n 40 "$work/build.log" >&2; exit 1; }

# Laid beside the target and moved in one step, so that a broken build is never found there.
kept="$target.new"
rm -rf "$kept"
mkdir -p "$kept"
cp -P "$work"/installed/lib/lib{EGL,GLESv2}.so* "$work"/installed/lib/libgallium-*.so \
    "$work"/installed/lib/lib{freedreno,panfrost}_noop_drm_shim.so "$kept"
strip --strip-unneeded "$kept"/*.so
echo "$MESA" >"$kept/version"
rm -rf "$target"
mv "$kept" "$target"
echo "Mesa $MESA's compilers are in $target."
