"""The command line: `rayfarm VERB`, a module of `server.cli_*` for each group of verbs."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import typer
from typer.exceptions import TyperException

from server import (
    cli_bench,
    cli_compare,
    cli_devices,
    cli_profile,
    cli_scenes,
    cli_service,
    cli_study,
    cli_submit,
    cli_up,
)
from server.spoken import spoken

BAD_INPUT = 2
INTERRUPTED = 130

app = typer.Typer(
    name="rayfarm",
    help="Measures ray-tracing acceleration structures on the devices that will run them.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)
for verbs in (cli_bench, cli_study, cli_service, cli_submit, cli_compare, cli_devices, cli_scenes, cli_profile, cli_up):
    verbs.register(app)


def run(arguments: Sequence[str]) -> int:
    """Run one verb; bad input ends in one sentence on standard error and exit code 2."""
    try:
        code = app(list(arguments), prog_name="rayfarm", standalone_mode=False)
    except TyperException as error:
        return _refuse(error.format_message())
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except (ValueError, RuntimeError) as error:
        sentence = spoken(error)
        if sentence is None:
            raise
        return _refuse(sentence)
    return code if isinstance(code, int) else 0


def main() -> None:
    """The entry point `rayfarm`."""
    sys.exit(run(sys.argv[1:]))


def _refuse(sentence: str) -> int:
    if sentence:
        ending = "" if sentence.endswith((".", ")", "?")) else "."
        print(f"rayfarm: {sentence}{ending}", file=sys.stderr)
    return BAD_INPUT


if __name__ == "__main__":
    main()
