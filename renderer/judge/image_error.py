"""How far an image is from the true one: PSNR, and FLIP (Andersson et al. 2020) in its LDR form.

FLIP comes from the package flip-evaluator, which has been seen to hang: it runs in a child process that is ended in
time. Our pictures' square root stands for sRGB's curve.
"""

from __future__ import annotations

import importlib
import math
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.process import end_with_parent

Image = npt.NDArray[np.uint8]

LIMIT_S = 120.0


@dataclass(frozen=True)
class ImageError:
    """`psnr` in dB; `flip` the mean FLIP, 0 to 1, or None with one sentence in `why_no_flip`."""

    psnr: float
    flip: float | None
    why_no_flip: str = ""


class FlipError(RuntimeError):
    """FLIP gave no figure; the message is one sentence."""


def image_error(image: Image, truth: Image, limit_s: float = LIMIT_S) -> ImageError:
    """Both figures of `image` (h, w, 3 or more) against `truth` (h, w, 3), rows in the same order."""
    image = _colours(image, truth)
    try:
        return ImageError(psnr(image, truth), flip(image, truth, limit_s))
    except FlipError as error:
        return ImageError(psnr(image, truth), None, str(error))


def psnr(image: Image, truth: Image) -> float:
    """The peak signal-to-noise ratio in dB over all pixels and colours.

    Equal images would have none, and get that of a single colour off by one level: the least that could be seen.
    """
    difference = _colours(image, truth).astype(np.float64) - truth
    square = max(float((difference**2).sum()), 1.0)
    return 10 * math.log10(255**2 * truth.size / square)


def flip(image: Image, truth: Image, limit_s: float = LIMIT_S) -> float:
    """The mean FLIP error at the package's default viewing distance; raise FlipError where there is none in time."""
    with tempfile.TemporaryDirectory(prefix="rayfarm-flip-") as folder:
        path = Path(folder) / "images.npz"
        np.savez(path, image=_colours(image, truth), truth=truth)
        command = [sys.executable, "-m", "renderer.judge.image_error", str(path), str(os.getpid())]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=True)
        except subprocess.TimeoutExpired as error:
            raise FlipError(f"FLIP was ended after {limit_s:g} s.") from error
        except subprocess.CalledProcessError as error:
            last = error.stderr.strip().splitlines()[-1:] or ["no reason given"]
            raise FlipError(f"FLIP failed: {last[0]}.") from error
    return float(done.stdout.split()[-1])


def _colours(image: Image, truth: Image) -> Image:
    if image.shape[:2] != truth.shape[:2] or truth.shape[2:] != (3,):
        raise ValueError("Two images can only be compared at one size; render both at the same size.")
    return image[..., :3]


def _work(path: str) -> float:
    """In the child: the mean FLIP of the images in `path`."""
    evaluator = importlib.import_module("flip_evaluator")
    with np.load(path) as images:
        image, truth = (images[name].astype(np.float32) / 255 for name in ("image", "truth"))
    _, mean, _ = evaluator.evaluate(truth, image, "LDR", applyMagma=False)
    return float(mean)


if __name__ == "__main__":
    end_with_parent(int(sys.argv[2]))
    print(_work(sys.argv[1]))
