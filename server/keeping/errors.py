"""The error of backups and pruning."""


class KeepingError(ValueError):
    """A backup or a pruning that cannot be; the message is one sentence that says what to do."""
