"""The report on an adapter: what it has, whether it computes rightly, and how fast everything is."""
