"""The scenes that come with the package, made from shapes."""
