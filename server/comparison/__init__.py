"""Stored results compared: pivoted, paired, exported."""
