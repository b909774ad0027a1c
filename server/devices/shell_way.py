"""The agent by `app_process` under the shell's user: its folder on the phone, its process, and their end."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import IO

from renderer.host import DeviceGoneError
from server.devices.adb import Phone, PhoneError
from server.devices.agent_package import MAIN, AgentPackage
from server.devices.agent_words import AgentWords
from server.devices.wire import OverdueError, Wire, shell_output

FOLDER = "/data/local/tmp/rayfarm"

# A process is the agent's if one of its words is the class's name. The brackets keep grep from finding itself; a
# process that waits for a driver may take a while to end, and a zombie has no words.
_CLEAR = r"""
turns=0
while found=$(grep -lzxs "$1" /proc/[0-9]*/cmdline); [ -n "$found" ] && [ $turns -lt 50 ]; do
    for file in $found; do process=${file#/proc/}; kill -9 "${process%/cmdline}" 2>/dev/null; done
    turns=$((turns + 1)); sleep 0.1
done
rm -rf "$2"
[ -z "$3" ] || mkdir -p "$3" || exit
[ -n "$found" ] && echo left || echo clear
"""
_CLASS = f"[{MAIN[0]}]{MAIN[1:].replace('.', '[.]')}"

_START = """
cd "$1" || exit
[ "$(sha256sum <agent.jar | cut -c 1-64)" = "$2" ] || { echo rayfarm torn; exit 1; }
export CLASSPATH="$1/agent.jar"
shift 2
exec app_process / "$@"
"""


class ShellWay:
    """Runs commands of the agent, one at a time."""

    name = "shell"

    def __init__(self, phone: Phone, package: AgentPackage, grace_s: float) -> None:
        """A run over its deadline has `grace_s` seconds to end itself before it is ended."""
        self._phone = phone
        self._package = package
        self._grace_s = grace_s
        self._words = AgentWords()

    def clear(self, *, fresh: bool) -> None:
        """End every process of the agent and remove its files, then make its folder if it is to be used (`fresh`).

        Raise PhoneError when a process does not end.
        """
        doing = "clearing what an earlier run left"
        said = self._phone.run(_CLEAR, _CLASS, FOLDER, FOLDER if fresh else "", doing=doing)
        if said.stdout.split() != [b"clear"]:
            raise PhoneError(
                f"An earlier run's process on the phone {self._phone.serial} cannot be ended: restart the phone."
            )

    def send(self, plan: IO[bytes] | None) -> None:
        """Push the agent and a plan."""
        with self._package.jar.open("rb") as jar:
            self._phone.push(jar, f"{FOLDER}/agent.jar", "pushing the agent")
        if plan is not None:
            self._phone.push(plan, f"{FOLDER}/plan", "pushing the plan")

    def run(self, verb: str, options: Sequence[str], deadline_s: float) -> None:
        """Run a command to its end; raise PhoneError when it has to be ended."""
        files = ["--out", f"{FOLDER}/record", *(["--plan", f"{FOLDER}/plan"] if verb == "run" else [])]
        command = [MAIN, verb, *options, "--deadline", f"{deadline_s:g}", *files]
        self._words = AgentWords()
        doing = "running the plan" if verb == "run" else "being probed"
        try:
            with self._phone.shell(_START, FOLDER, self._package.sha256, *command, doing=doing) as wire:
                wire.until = time.monotonic() + deadline_s + self._grace_s
                ended = self._listen(wire)
        except DeviceGoneError as error:
            raise DeviceGoneError(f"{error} The agent's last word was: {self._words.phase}.") from error
        if not ended:
            self._end(deadline_s)

    def fetch(self, record: IO[bytes], most: int) -> None:
        """Pull the record; raise PhoneError when the agent ended without one."""
        try:
            self._phone.pull(f"{FOLDER}/record", record, "pulling the record", most)
        except PhoneError as error:
            if self._words.phase == "torn":
                raise PhoneError(f"The agent's jar came to the phone {self._phone.serial} damaged.") from error
            raise PhoneError(
                f"The agent left no record that can be read; its last word was: {self._words.phase}; "
                f"its last error: {self._words.last_error}. ({error})"
            ) from error

    def _listen(self, wire: Wire) -> bool:
        """Hear the agent out; False when its time is over. It may be silent for long."""
        wire.patience_s = math.inf
        try:
            for kind, piece in shell_output(wire):
                self._words.hear(kind, piece)
        except OverdueError:
            return False
        return True

    def _end(self, deadline_s: float) -> None:
        self.clear(fresh=False)
        raise PhoneError(
            f"The agent did not end within its deadline of {deadline_s:g} s and was ended: its GPU hangs, or the plan "
            f"takes longer. Its last word was: {self._words.phase}."
        )
