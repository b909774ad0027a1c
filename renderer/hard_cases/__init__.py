"""Every variant against every hard case: what it got wrong, what it cost, and that it always answers."""
