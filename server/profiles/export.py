"""All metrics of a job's profiles as one table."""

from __future__ import annotations

from collections.abc import Sequence

from server.comparison.flat import to_csv
from server.profiles.store import profile_view
from server.store.models import Profile

COLUMNS = (
    *("profile", "format", "file_name", "name", "instance", "source", "unit"),
    *("count", "mean", "median", "min", "max", "first_time", "last_time"),
)


def metrics_csv(profiles: Sequence[Profile]) -> str:
    """A line a series, what was not told empty; inert in a spreadsheet, since the names are a file's."""
    import pandas as pd

    rows = []
    for profile in profiles:
        view = profile_view(profile, with_metrics=True)
        known = {"profile": view["id"], "format": view["format"], "file_name": view["file_name"]}
        rows += [known | metric for metric in view["metrics"]]
    return to_csv(pd.DataFrame.from_records(rows, columns=list(COLUMNS)), index=False)
