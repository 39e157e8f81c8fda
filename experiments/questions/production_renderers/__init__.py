"""Production renderers on the scenes and maps of this project, beside its own renderer."""
