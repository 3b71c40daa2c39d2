"""Error budgets: what a picture errs by, and how much work makes it err less."""
