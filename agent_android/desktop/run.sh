#!/usr/bin/env bash
# Runs the agent's classes on the desktop JVM over the shim: run.sh CLASSES_JAR MAIN ARGS...
# CLASSES_JAR is agent_android/build/agent-desktop.jar, or what enjarify makes of a pushed agent.jar.
set -euo pipefail
desktop="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/../build/desktop"
[ -e "$desktop/desktop.jar" ] || { echo "The desktop shim is not built: run python -m agent_android.build desktop." >&2; exit 1; }
classes=$1
main=$2
shift 2
export EGL_PLATFORM=surfaceless MESA_GLES_VERSION_OVERRIDE=3.1
exec java -Xss8m -Xshare:auto -XX:+UseSerialGC -XX:TieredStopAtLevel=1 \
    -Dorg.lwjgl.librarypath="$desktop/natives" -Dorg.lwjgl.egl.libname=libEGL.so.1 \
    -Dorg.lwjgl.opengles.libname=libGLESv2.so.2 \
    -cp "$classes:$desktop/*" "$main" "$@"
