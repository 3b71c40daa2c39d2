"""Budgets of time and error: candidates are measured, the best is refined, and what a picture errs by is certified."""
