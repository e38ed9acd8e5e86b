"""Loop closures: places of the present session that are seen again."""
