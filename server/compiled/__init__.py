"""Variants compiled for phone GPUs: their listings in the blobs, and their estimates beside a phone's own figures."""
