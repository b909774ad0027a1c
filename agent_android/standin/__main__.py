"""`python -m agent_android.standin`: stand-in phones for a developer without a phone, until Ctrl-C."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from contextlib import ExitStack
from types import FrameType
from typing import NoReturn

from agent_android.standin.errors import StandInError
from agent_android.standin.phone import StandInPhone

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK_S = 1.0


def main() -> int:
    """Runs the phones; the exit status is 1 where they cannot be had."""
    parent = os.getppid()
    options = _options()
    for number in ENDING:
        signal.signal(number, _end)
    try:
        with ExitStack() as phones:
            for at in range(options.count):
                _say(phones.enter_context(_phone(options, at)))
            while os.getppid() == parent:
                time.sleep(LOOK_S)
    except StandInError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m agent_android.standin", description=__doc__)
    parser.add_argument("--port", type=int, default=15555, help="the first phone's port; the others follow it")
    parser.add_argument("--count", type=int, default=1, help="how many phones")
    parser.add_argument("--model", help="the model name that they give")
    parser.add_argument("--battery", type=int, default=87, help="charge in percent")
    parser.add_argument("--thermal", type=int, default=0, choices=range(7), help="Android's thermal status")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="environment of app_process")
    return parser.parse_args()


def _phone(options: argparse.Namespace, at: int) -> StandInPhone:
    phone = StandInPhone(port=options.port + at)
    if options.model is not None:
        phone.persona.set_model(options.model)
    phone.persona.set_battery(options.battery)
    phone.persona.set_thermal(options.thermal)
    phone.persona.set_environment(**dict(one.split("=", 1) for one in options.set))
    return phone


def _say(phone: StandInPhone) -> None:
    print(f"A phone is at {phone.serial}, its files in {phone.root}:", flush=True)
    print(f"  adb connect {phone.serial}", flush=True)
    print(f"  rayfarm devices attach {phone.serial}", flush=True)


def _end(number: int, frame: FrameType | None) -> NoReturn:
    sys.exit(0)


if __name__ == "__main__":
    sys.exit(main())
