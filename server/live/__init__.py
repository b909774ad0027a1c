"""Changes of state as they happen, in an order that never skips one."""
