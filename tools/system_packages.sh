#!/usr/bin/env bash
# Installs the system packages that are missing, for `run`, `agent`, `test` or `phone-compiler`; asks for root only if something is missing.
set -euo pipefail

library() { ldconfig -p | grep -q "$1"; }
program() { command -v "$1" >/dev/null 2>&1; }

wanted=()
library libEGL.so.1 || wanted+=(libegl1)
library libGL.so.1 || wanted+=(libgl1)
compgen -G "/usr/share/glvnd/egl_vendor.d/*" >/dev/null || wanted+=(libegl-mesa0)
compgen -G "/usr/lib/*/dri/swrast_dri.so" >/dev/null || library libgallium || wanted+=(libgl1-mesa-dri)
program glslangValidator || wanted+=(glslang-tools)
python3 -c "import ensurepip, venv" 2>/dev/null || wanted+=(python3-venv)
case "${1:-run}" in agent | test)
    program javac || wanted+=(default-jdk-headless)
    program mvn || wanted+=(maven)
    for tool in aapt zipalign apksigner; do program "$tool" || wanted+=("$tool"); done
    ;;
esac
if [ "${1:-run}" = test ]; then
    for tool in dexdump enjarify; do program "$tool" || wanted+=("$tool"); done
    library libGLESv2.so.2 || wanted+=(libgles2)
    program cc || wanted+=(gcc libc6-dev)
    program setpriv || wanted+=(util-linux)
    program pgrep || wanted+=(procps)
    program initdb || compgen -G "/usr/lib/postgresql/*/bin/initdb" >/dev/null || wanted+=(postgresql)
    if ! program chromium && ! program google-chrome; then wanted+=(chromium chromium-driver); fi
fi
if [ "${1:-run}" = phone-compiler ]; then
    for tool in bison flex strip tar xz; do
        program "$tool" || wanted+=("$(case "$tool" in strip) echo binutils ;; xz) echo xz-utils ;; *) echo "$tool" ;; esac)")
    done
    program g++ || wanted+=(g++)
    program ninja || wanted+=(ninja-build)
    program pkg-config || wanted+=(pkg-config)
    pkg-config --exists libdrm 2>/dev/null || wanted+=(libdrm-dev)
    pkg-config --exists zlib 2>/dev/null || wanted+=(zlib1g-dev)
    [ -f /usr/share/keyrings/debian-archive-keyring.gpg ] || wanted+=(debian-archive-keyring)
fi
[ "${#wanted[@]}" -gt 0 ] || exit 0

if ! program apt-get; then
    echo "These packages are missing and there is no apt-get here: ${wanted[*]}. Install their like, then run make again." >&2
    exit 1
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
    echo "Installing ${wanted[*]} needs root." >&2
    as_root=(sudo)
fi
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${wanted[@]}" >/dev/null
