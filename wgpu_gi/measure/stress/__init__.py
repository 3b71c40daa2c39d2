"""The stress lab: random scenes against exact relations and the path tracer, on the user's adapter."""
