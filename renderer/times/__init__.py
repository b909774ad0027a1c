"""Medians, ratios and differences of times, with their intervals."""
