"""The verbs of `rayfarm`, a file each."""
