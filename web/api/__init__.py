"""Routes of `/api/v1` and of health, a file or a folder for each concept."""
