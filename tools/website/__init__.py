"""The documentation site: what it is made of, put together and rendered by Sphinx."""
