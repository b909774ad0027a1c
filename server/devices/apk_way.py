"""The agent as an app, for phones whose shell may not make an OpenGL ES context. Unproven on a phone.

The APK is debuggable, so `run-as` reaches the app's own folder; its Activity takes the words of the command line as
the string array `args`, its paths from that folder, and its process ends with the run. The app needs the screen.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import IO

from server.devices.adb import Phone, PhoneError
from server.devices.agent_package import PACKAGE, AgentPackage
from server.devices.words import plain, require_package

FOLDER = "/data/local/tmp/rayfarm"
_POLL_S = 0.2
_INSTALL_S = 120.0

# Two marks outlive a run that lost its phone: our APK is in the folder while an app that we installed is on the phone,
# and `woken` while a screen that we woke is lit.
_CLEAR = """
[ ! -e "$2/agent.apk" ] || pm uninstall "$1" >/dev/null
[ -z "$(pm path "$1" 2>/dev/null)" ] || { am force-stop "$1"; run-as "$1" sh -c "rm -rf files/plan files/record*"; }
[ ! -e "$2/woken" ] || input keyevent KEYCODE_SLEEP
rm -rf "$2"
[ -z "$3" ] || mkdir -p "$3" || exit
echo clear
"""
# The app may read /data/local/tmp only on some phones: the shell reads for it.
_GIVE = 'run-as "$1" sh -c "mkdir -p files && cat >files/plan" <"$2" && rm "$2" && echo given'
_TAKE = 'run-as "$1" cat files/record >"$2"'
_WAKE = """
case $(dumpsys power | grep -m1 mWakefulness=) in *Awake*) exit ;; esac
touch "$1/woken"; input keyevent KEYCODE_WAKEUP; wm dismiss-keyguard
"""


class ApkWay:
    """Runs commands of the agent, one at a time; an app that was not there before is removed afterwards."""

    name = "apk"

    def __init__(self, phone: Phone, package: AgentPackage, grace_s: float) -> None:
        """As for ShellWay."""
        self._phone = phone
        self._package = package
        self._grace_s = grace_s
        self._name = require_package(PACKAGE)

    def clear(self, *, fresh: bool) -> None:
        """End the app and remove its files; leave the screen and the installed apps as an earlier run found them."""
        words = (self._name, FOLDER, FOLDER if fresh else "")
        said = self._phone.run(_CLEAR, *words, doing="clearing what an earlier run left", timeout_s=_INSTALL_S)
        if said.stdout.split() != [b"clear"]:
            raise PhoneError(f"The phone {self._phone.serial} cannot be cleared: {plain(said.stderr)}.")

    def send(self, plan: IO[bytes] | None) -> None:
        """Install the app unless it is there, and push a plan into its folder."""
        if not self._phone.run('pm path "$1"', self._name, doing="looking for the agent").stdout.strip():
            self._install()
        if plan is not None:
            self._phone.push(plan, f"{FOLDER}/plan", "pushing the plan")
            said = self._phone.run(_GIVE, self._name, f"{FOLDER}/plan", doing="handing the plan over", timeout_s=120.0)
            if b"given" not in said.stdout:
                raise PhoneError(f"The agent's app cannot be given the plan: {plain(said.stderr)}.")

    def run(self, verb: str, options: Sequence[str], deadline_s: float) -> None:
        """Start the Activity and wait until its record is there; raise PhoneError when it has to be ended."""
        self._phone.run(_WAKE, FOLDER, doing="waking its screen")
        files = ["--out", "record", *(["--plan", "plan"] if verb == "run" else [])]
        # `--esa` splits its value at commas.
        words = ",".join(word.replace(",", r"\,") for word in [verb, *options, "--deadline", f"{deadline_s:g}", *files])
        script = 'am start -W -n "$1/.AgentActivity" --esa args "$2"'
        self._phone.run(script, self._name, words, doing="starting the agent")
        until = time.monotonic() + deadline_s + self._grace_s
        ended = 'run-as "$1" test -e files/record || [ -z "$(pidof "$1")" ] && echo ended'
        while b"ended" not in self._phone.run(ended, self._name, doing=f"running ({verb})").stdout:
            if time.monotonic() > until:
                raise PhoneError(f"The agent's app did not end within its deadline of {deadline_s:g} s, and was ended.")
            time.sleep(_POLL_S)

    def fetch(self, record: IO[bytes], most: int) -> None:
        """Pull the record."""
        said = self._phone.run(_TAKE, self._name, f"{FOLDER}/record", doing="taking the record", timeout_s=120.0)
        if said.code != 0:
            raise PhoneError(f"The agent's app left no record: {plain(said.stderr)}.")
        self._phone.pull(f"{FOLDER}/record", record, "pulling the record", most)

    def _install(self) -> None:
        if not self._package.apk.exists():
            raise PhoneError("The agent's APK is not built: run `make agent`.")
        with self._package.apk.open("rb") as apk:
            self._phone.push(apk, f"{FOLDER}/agent.apk", "pushing the agent")
        said = self._phone.run(
            'pm install -t "$1"', f"{FOLDER}/agent.apk", doing="installing the agent", timeout_s=_INSTALL_S
        )
        if b"Success" not in said.stdout:
            raise PhoneError(f"The agent's APK cannot be installed: {plain(said.stdout + b' ' + said.stderr)}.")
