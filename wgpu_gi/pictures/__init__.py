"""Pictures and tables as values and as files; nothing here needs a GPU."""
