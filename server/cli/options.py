"""The options that `bench` and `heatmap` share, and the error of one that is not understood."""

from __future__ import annotations

from typing import Annotated

import typer

SceneArgument = Annotated[str, typer.Argument(help="A scene of the catalogue, or any mesh file.")]
SizeOption = Annotated[str, typer.Option(help="The image in pixels, as 512 or 640x480.", metavar="W[xH]")]
SahOption = Annotated[str, typer.Option(help="The SAH's costs of a traversal step and a test.", metavar="CT,CI")]
CameraOption = Annotated[
    tuple[str, str, str] | None,
    typer.Option(
        help='In place of the scene\'s own: "x,y,z" "x,y,z" and the vertical field of view in degrees.',
        metavar="EYE TARGET FOV",
        show_default=False,
    ),
]


class OptionError(ValueError):
    """An option that is not understood; the message is one sentence that says how to write it."""
