"""The scenes that come with the package, made of simple shapes."""
