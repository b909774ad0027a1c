"""What is kept, and for how long: backups of a whole store, and the pruning of raw frames and files."""
