"""What is missing on a machine, and how to mend it: `rayfarm doctor`. A module here for each group of checks."""
