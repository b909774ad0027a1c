"""What a job has that names no device and no priority."""

from __future__ import annotations

LLVMPIPE = "llvmpipe"
"""The device of jobs that any llvmpipe host may run."""
NORMAL_PRIORITY = 100
"""The priority of jobs that name none: 1 is the most urgent."""
