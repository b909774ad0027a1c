"""The fastest variant within budgets."""
