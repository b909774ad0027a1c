"""The HTTP API under /api/v1, a file a subject."""
