"""The command line: `rayfarm VERB`, a module here for each group of verbs."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import typer
from typer.exceptions import TyperException

from server.cli import bench as cli_bench
from server.cli import compare as cli_compare
from server.cli import compile as cli_compile
from server.cli import devices as cli_devices
from server.cli import doctor as cli_doctor
from server.cli import keeping as cli_keeping
from server.cli import profile as cli_profile
from server.cli import recommend as cli_recommend
from server.cli import scenes as cli_scenes
from server.cli import service as cli_service
from server.cli import study as cli_study
from server.cli import submit as cli_submit
from server.cli import tokens as cli_tokens
from server.cli import up as cli_up
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
for verbs in (
    cli_bench,
    cli_recommend,
    cli_compile,
    cli_study,
    cli_service,
    cli_submit,
    cli_compare,
    cli_devices,
    cli_scenes,
    cli_profile,
    cli_up,
    cli_tokens,
    cli_keeping,
    cli_doctor,
):
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
