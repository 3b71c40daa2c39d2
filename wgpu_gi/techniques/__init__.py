"""One folder or module per technique: settings, scene inputs, and functions that declare its passes."""
