"""One module per technique: a settings dataclass, a result dataclass, and a function that declares its passes."""
