"""The store: studies, jobs, slices, results and their changes of state."""
