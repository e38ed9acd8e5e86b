"""What may come in by HTTP: pydantic models, strict about types, keys and finite numbers; a file
for each kind of thing."""
