"""Studies of hard cases: their documents checked, stored, laid out as tables, and held against each other."""
