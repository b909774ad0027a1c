"""What is wrong with a profiler's file."""

from __future__ import annotations


class ProfileError(ValueError):
    """A file that cannot be imported; the message is one sentence that says what to do."""

    def __init__(self, sentence: str) -> None:
        # What it quotes of the file may span lines.
        super().__init__(" ".join(sentence.split()))
