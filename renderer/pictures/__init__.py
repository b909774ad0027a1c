"""A run's image and what its pixels fetched, as files and heatmaps."""
