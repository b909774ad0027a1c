"""Pictures of jobs: the rendered image and the counts of every pixel, kept as blobs, drawn and compared on request."""
