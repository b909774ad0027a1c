"""How far off hit records and pictures are: the oracle, the exact referee, and what an error is called."""
